"""What a run costs on a machine of IBM's: jobs, executions, seconds.

Sources: IBM Quantum documentation, "Workload usage" (estimate job run time) and "Job limits".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from qcompile.arrays import IntArray
from qcompile.limits import MAX_EXECUTIONS_PER_JOB, SECONDS_PER_EXECUTION, SECONDS_PER_JOB


def qpu_seconds(jobs: int, executions: int) -> float:
    """IBM's published estimate; executions = circuits after packing times shots."""
    return SECONDS_PER_JOB * jobs + SECONDS_PER_EXECUTION * executions


@dataclass(frozen=True)
class Portion:
    """What of a batch one job holds: rows of the batch, and rounds of each of them."""

    rows: range
    rounds: range


def portions(rows: int, rounds: int, shots: int) -> Iterator[Portion]:
    """The jobs of a batch of `rows` bindings of a program in `rounds`, `shots` each.

    One job, as long as it has at most MAX_EXECUTIONS_PER_JOB executions; else jobs of as many whole
    rows as fit, or of as many rounds of one row.
    """
    if rows * rounds * shots <= MAX_EXECUTIONS_PER_JOB:
        yield Portion(range(rows), range(rounds))
        return
    together = MAX_EXECUTIONS_PER_JOB // (rounds * shots)
    if together:
        for start in range(0, rows, together):
            yield Portion(range(start, min(start + together, rows)), range(rounds))
        return
    together = MAX_EXECUTIONS_PER_JOB // shots
    for row in range(rows):
        for start in range(0, rounds, together):
            yield Portion(range(row, row + 1), range(start, min(start + together, rounds)))


def job_counts(rows: IntArray, rounds: int, shots: int) -> IntArray:
    """How many jobs `portions` makes of batches of so many rows, for an array of any shape."""
    if together := MAX_EXECUTIONS_PER_JOB // (rounds * shots):
        return np.maximum(-(-rows // together), 1)
    return np.maximum(rows * -(-rounds // (MAX_EXECUTIONS_PER_JOB // shots)), 1)


@dataclass(frozen=True)
class Workload:
    """Jobs and their executions; workloads add up."""

    jobs: int = 0
    executions: int = 0

    @classmethod
    def of_batch(cls, rows: int, rounds: int, shots: int) -> Workload:
        """That of `portions`."""
        return cls(sum(1 for _ in portions(rows, rounds, shots)), rows * rounds * shots)

    def __add__(self, other: Workload) -> Workload:
        return Workload(self.jobs + other.jobs, self.executions + other.executions)

    def __mul__(self, times: int) -> Workload:
        return Workload(times * self.jobs, times * self.executions)

    @property
    def qpu_seconds(self) -> float:
        return qpu_seconds(self.jobs, self.executions)
