"""How many decisions of each episode one job measures: chosen before it from earlier jobs alone."""

from __future__ import annotations

from typing import Literal

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.execution import Workload
from qcompile.execution.cost import qpu_seconds
from qcompile.limits import MAX_EXECUTIONS_PER_JOB, MOST_AHEAD

Speculate = int | Literal["auto"]
"""Decisions of each episode that a job measures: their number, or as many as pay."""

_PRIOR_AGREED, _PRIOR_COMPARED = 9.0, 10.0
"""Before anything is compared nine of ten predictions are taken to be right."""
_DEPTHS = np.arange(1.0, MOST_AHEAD + 1)


class Depth:
    """The depth D of every job of a run: `speculate` itself, or with "auto" what pays best.

    A row is the measurement of one decision. `note` tells after each job how many of its rows
    counted, and of how many of these the measured action was the predicted one. With "auto" D is a
    function of these tallies and of the load of the job alone: the same run has the same D again,
    and no D depends on counts of its own job.
    """

    def __init__(self, speculate: Speculate):
        self.speculate = speculate
        self._compared, self._agreed = _PRIOR_COMPARED, _PRIOR_AGREED

    @property
    def agreement(self) -> float:
        """How probable it is that a prediction is right, as far as known."""
        return self._agreed / self._compared

    def next(self, load: Workload) -> int:
        """D of the next job; `load` is that of one row of each living episode."""
        if self.speculate == "auto":
            return deepest_that_pays(self.agreement, load)
        return self.speculate

    def note(self, compared: int, agreed: int) -> None:
        """Of a job `compared` rows counted; in `agreed` of them the prediction was right."""
        self._compared += compared
        self._agreed += agreed


def accepted(agreement: float, depths: FloatArray) -> FloatArray:
    """The expected decisions of an episode that count, of jobs that measure `depths` of them.

    The first always counts, the next as long as all predictions before were right:
    1 + p + ... + p^(D - 1).
    """
    if agreement >= 1.0:
        return np.asarray(depths, dtype=np.float64)
    return np.asarray((1.0 - agreement**depths) / (1.0 - agreement))


def seconds(load: Workload, depths: FloatArray) -> FloatArray:
    """The QPU seconds of jobs that measure `depths` rows of each episode, `load` being that of one.

    A job that IBM does not take whole becomes several.
    """
    jobs = np.ceil(depths * load.executions / MAX_EXECUTIONS_PER_JOB)
    jobs = np.maximum(jobs, 1.0 if load.jobs <= 1 else depths * load.jobs)
    return qpu_seconds(jobs, depths * load.executions)


def deepest_that_pays(agreement: float, load: Workload) -> int:
    """D at which a job brings each living episode most expected decisions a QPU second.

    Episodes walk in lockstep, and the longest decides how many jobs there are: so what counts is
    the progress of each, not the sum over them.
    """
    gain = accepted(agreement, _DEPTHS) / seconds(load, _DEPTHS)
    return 1 + int(gain.argmax())
