"""Planning, before anything is sent: what a run takes, and the cheapest settings that keep a reward."""
