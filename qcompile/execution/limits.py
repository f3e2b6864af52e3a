"""Limits that need no other module, so that a command line can name them cheaply."""

MAX_SHOTS = 10_000_000
"""IBM's limit of executions in one job."""
