"""The number of decisions of each episode that a job measures, chosen from earlier jobs only."""

from __future__ import annotations

from typing import Literal

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.execution import Workload
from qcompile.execution.cost import qpu_seconds
from qcompile.limits import MAX_EXECUTIONS_PER_JOB, MOST_AHEAD

Speculate = int | Literal["auto"]
"""Decisions of each episode that a job measures: a number, or "auto" for the most efficient one."""

_PRIOR_AGREED, _PRIOR_COMPARED = 9.0, 10.0
"""A prior: nine of ten predictions are assumed to be right before any comparison."""
_DEPTHS = np.arange(1.0, MOST_AHEAD + 1)


class Depth:
    """The depth D of every job of a run: `speculate`, or with "auto" the most efficient one.

    A row is the measurement of one decision. `note` records after each job how many of its rows
    counted, and how many of these were predicted correctly. With "auto", D is a function of these
    tallies and of the load of the job only: a repeated run has the same D, and no D depends on
    counts of its own job.
    """

    def __init__(self, speculate: Speculate):
        self.speculate = speculate
        self._compared, self._agreed = _PRIOR_COMPARED, _PRIOR_AGREED

    @property
    def agreement(self) -> float:
        """The estimated probability that a prediction is right."""
        return self._agreed / self._compared

    def next(self, load: Workload) -> int:
        """D of the next job; `load` is the load of one row of each running episode."""
        if self.speculate == "auto":
            return deepest_that_pays(self.agreement, load)
        return self.speculate

    def note(self, compared: int, agreed: int) -> None:
        """Record that `compared` rows of a job counted, `agreed` of them predicted correctly."""
        self._compared += compared
        self._agreed += agreed


def accepted(agreement: float, depths: FloatArray) -> FloatArray:
    """The expected number of decisions that count when a job measures `depths` of an episode.

    The first always counts, the next ones while all earlier predictions were right: 1 + p + ... +
    p^(D - 1).
    """
    if agreement >= 1.0:
        return np.asarray(depths, dtype=np.float64)
    return np.asarray((1.0 - agreement**depths) / (1.0 - agreement))


def seconds(load: Workload, depths: FloatArray) -> FloatArray:
    """QPU seconds of jobs with `depths` rows of each episode, where `load` is for one row each.

    A job that is too large for IBM becomes several.
    """
    jobs = np.ceil(depths * load.executions / MAX_EXECUTIONS_PER_JOB)
    jobs = np.maximum(jobs, 1.0 if load.jobs <= 1 else depths * load.jobs)
    return qpu_seconds(jobs, depths * load.executions)


def deepest_that_pays(agreement: float, load: Workload) -> int:
    """The D with the most expected decisions of each running episode per QPU second.

    Episodes advance in lockstep, and the longest determines the number of jobs: so the progress of
    each episode counts, not the sum over all.
    """
    gain = accepted(agreement, _DEPTHS) / seconds(load, _DEPTHS)
    return 1 + int(gain.argmax())
