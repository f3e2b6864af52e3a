"""Play a policy on a backend: settings, measurement, episodes in lockstep."""
