"""Planning: what a run takes, and the cheapest settings that keep the reward, before it is sent."""
