"""Planning: the cheapest settings that keep a policy's reward, found before anything is sent."""
