"""The cost of a run on an IBM machine: jobs, executions, seconds.

Sources: IBM Quantum documentation, "Workload usage" (estimate job run time) and "Job limits".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.limits import MAX_EXECUTIONS_PER_JOB, SECONDS_PER_EXECUTION, SECONDS_PER_JOB

Number = TypeVar("Number", float, FloatArray)


def qpu_seconds(jobs: Number, executions: Number) -> Number:
    """IBM's published estimate of QPU seconds; executions = circuits after packing times shots."""
    return SECONDS_PER_JOB * jobs + SECONDS_PER_EXECUTION * executions


@dataclass(frozen=True)
class Portion:
    """The part of a PUB in one job: some rows of its parameter values."""

    pub: int
    rows: range


def portions(rows: Sequence[int], shots: int) -> list[list[Portion]]:
    """The jobs for PUBs with these numbers of `rows` of parameter values, `shots` per row.

    It is one job if that has at most MAX_EXECUTIONS_PER_JOB executions; otherwise each job is
    filled with rows before the next begins.
    """
    jobs: list[list[Portion]] = []
    room = 0
    for pub, count in enumerate(rows):
        start = 0
        while start < count:
            if not room:
                jobs.append([])
                room = MAX_EXECUTIONS_PER_JOB // max(shots, 1)  # exact: none
            taken = min(room, count - start)
            jobs[-1].append(Portion(pub, range(start, start + taken)))
            start, room = start + taken, room - taken
    return jobs


def job_counts(circuits: IntArray, shots: int) -> IntArray:
    """The number of jobs that `portions` makes for `circuits` rows, an array of any shape.

    An exact expectation counts as one shot.
    """
    return np.asarray(-(-circuits // (MAX_EXECUTIONS_PER_JOB // max(shots, 1))))


@dataclass(frozen=True)
class Workload:
    """A number of jobs and their executions; workloads can be added."""

    jobs: int = 0
    executions: int = 0

    @classmethod
    def of_batch(cls, rows: int, rounds: int, shots: int) -> Workload:
        """The workload of `rounds` circuits, each with `rows` rows of values, by `portions`."""
        circuits = rows * rounds
        return cls(int(job_counts(np.array(circuits), shots)), circuits * shots)

    def __add__(self, other: Workload) -> Workload:
        return Workload(self.jobs + other.jobs, self.executions + other.executions)

    def __mul__(self, times: int) -> Workload:
        return Workload(times * self.jobs, times * self.executions)

    @property
    def qpu_seconds(self) -> float:
        return qpu_seconds(self.jobs, self.executions)
