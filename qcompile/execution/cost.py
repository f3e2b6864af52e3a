"""What a run would cost on a machine of IBM's."""

from __future__ import annotations

SECONDS_PER_JOB = 2.0
SECONDS_PER_EXECUTION = 0.00035


def qpu_seconds(jobs: int, executions: int) -> float:
    """IBM's published estimate; executions = circuits after packing times shots.

    Source: IBM Quantum documentation, "Workload usage" (estimate job run time).
    """
    return SECONDS_PER_JOB * jobs + SECONDS_PER_EXECUTION * executions
