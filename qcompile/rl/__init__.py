"""Reinforcement learning: the trainer, its models, presets and checkpoints."""
