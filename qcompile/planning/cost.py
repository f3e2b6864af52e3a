"""The cost of runs on a machine: its mean and an interval."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from qcompile.arrays import BoolArray, IntArray
from qcompile.deploy.depth import Depth, Speculate
from qcompile.execution import Workload
from qcompile.execution.cost import job_counts, qpu_seconds
from qcompile.planning.chains import Chains

RESAMPLES = 100
"""Resampled runs for a mean and an interval."""
_PERCENT = 10.0, 90.0


@dataclass(frozen=True)
class Packing:
    """How rows are measured: `shots` in each execution of a program of `rounds` circuits.

    Rows of up to `copies` episodes share an execution, each in the copy given by its episode modulo
    `copies`; a row whose shots are split over all copies has its own execution.
    """

    rounds: int
    shots: int
    copies: int = 1

    def programs(self, rows: IntArray) -> IntArray:
        """Executions of the program in each job, (jobs,), for rows (jobs, episodes)."""
        if self.copies == 1:
            return np.asarray(rows.sum(axis=1))
        jobs, episodes = rows.shape
        full = np.zeros((jobs, -(-episodes // self.copies) * self.copies), dtype=np.intp)
        full[:, :episodes] = rows
        return np.asarray(full.reshape(jobs, -1, self.copies).sum(axis=1).max(axis=1))

    def load(self, rows: IntArray) -> Workload:
        """Jobs and executions of rows (jobs, episodes)."""
        circuits = self.programs(rows) * self.rounds
        jobs = int(job_counts(circuits, self.shots).sum())
        return Workload(jobs, int(circuits.sum()) * self.shots)


@dataclass(frozen=True, eq=False)
class Price:
    """The cost of runs of `episodes` episodes like those in the chains, at a depth.

    Runs are resampled: their episodes are drawn with replacement from the chains, by `seed`, since
    a machine has its own noise even with the same resets. `calibration` is the load of the
    calibration before the first episode.
    """

    chains: Chains
    episodes: int
    packing: Packing
    speculate: Speculate
    calibration: Workload
    seed: int = 0

    @cached_property
    def load(self) -> Workload:
        """Mean jobs and executions of a run, each rounded, including the calibration."""
        jobs, executions = np.mean([(run.jobs, run.executions) for run in self._runs], axis=0)
        return Workload(round(jobs), round(executions))

    @cached_property
    def seconds(self) -> float:
        """The mean QPU seconds of a run."""
        return float(np.mean([run.qpu_seconds for run in self._runs]))

    @cached_property
    def seconds_80(self) -> tuple[float, float]:
        """The 80 % interval of the QPU seconds of a run."""
        low, high = np.percentile([run.qpu_seconds for run in self._runs], _PERCENT)
        return float(low), float(high)

    @cached_property
    def _runs(self) -> list[Workload]:
        rng = np.random.default_rng(self.seed)
        drawn = rng.integers(len(self.chains.decisions), size=(RESAMPLES, self.episodes))
        return [self._load_of(some) + self.calibration for some in drawn]

    @cached_property
    def _rows(self) -> IntArray:
        assert isinstance(self.speculate, int)
        return self.chains.rows(self.speculate)

    def _load_of(self, episodes: IntArray) -> Workload:
        if self.speculate == "auto":
            rows = self.chains.take(episodes).rows_of(Depth("auto"), self._one_row_each)
        else:
            rows = self._rows[:, episodes]
            rows = rows[rows.any(axis=1)]
        return self.packing.load(rows)

    def _one_row_each(self, living: BoolArray) -> Workload:
        return self.packing.load(living.astype(np.intp)[None])


def at_sub_jobs(load: Workload, sub_jobs: int = 4) -> float:
    """QPU seconds if IBM counts each job as `sub_jobs` sub-jobs."""
    return qpu_seconds(sub_jobs * load.jobs, load.executions)
