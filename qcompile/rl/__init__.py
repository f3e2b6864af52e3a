"""Reinforcement learning: environments, training, and playing with a policy on a backend."""
