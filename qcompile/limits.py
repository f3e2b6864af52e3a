"""Limits that need no other module, so that a command line can name them at no cost."""

MAX_EXECUTIONS_PER_JOB = 10_000_000
"""IBM's limit: circuits after packing times shots."""

MAX_SHOTS = MAX_EXECUTIONS_PER_JOB
"""More shots of one circuit do not fit one job."""

MAX_EPISODES = 10_000
"""Episodes of one run; each keeps an environment alive."""
