"""Planning: the cost of a run, and the cheapest settings that keep the reward."""
