"""The rows that speculation measures in each job, given where predictions are right.

From episodes played with one job per decision, and a record of which predicted actions were
measured, follow the rows of every job at every depth: in each job an episode advances to its first
wrong prediction, which still counts, or by the depth, or to its end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from qcompile.arrays import BoolArray, IntArray
from qcompile.deploy.depth import Depth
from qcompile.execution import Workload


@dataclass(frozen=True, eq=False)
class Chains:
    """For each decision of some episodes, whether the predicted action was measured.

    `agree` is (episodes, most decisions); only the first `decisions` (episodes,) entries of an
    episode are meaningful.
    """

    agree: BoolArray
    decisions: IntArray

    @cached_property
    def _stop(self) -> IntArray:
        """For each decision, the first wrong prediction at or after it, or the width."""
        width = self.agree.shape[1]
        wrong = np.where(self.agree, width, np.arange(width))
        return np.asarray(np.minimum.accumulate(wrong[:, ::-1], axis=1)[:, ::-1])

    @cached_property
    def _wrong(self) -> IntArray:
        """The number of wrong predictions before each decision, (episodes, width + 1)."""
        zero = np.zeros((len(self.agree), 1), dtype=np.intp)
        return np.concatenate([zero, (~self.agree).cumsum(axis=1)], axis=1)

    def cut(self, decisions: int) -> Chains:
        """The same episodes, each stopped after `decisions` of its decisions."""
        return Chains(self.agree[:, :decisions], np.minimum(self.decisions, decisions))

    def take(self, episodes: IntArray) -> Chains:
        """A selection of the episodes, by number, possibly with repeats."""
        return Chains(self.agree[episodes], self.decisions[episodes])

    def rows(self, depth: int) -> IntArray:
        """The rows of each episode in each job, (jobs, episodes), at most `depth` of each."""
        return self._walk(lambda living: depth, lambda compared, agreed: None)

    def rows_of(self, depth: Depth, load: Callable[[BoolArray], Workload]) -> IntArray:
        """The rows of each episode in each job, (jobs, episodes), with depths chosen by `depth`.

        `load` maps `living` (episodes,) to the load of one row of each running episode.
        """
        return self._walk(lambda living: depth.next(load(living)), depth.note)

    def _walk(
        self, next_depth: Callable[[BoolArray], int], note: Callable[[int, int], None]
    ) -> IntArray:
        at, every = np.zeros(len(self.decisions), dtype=np.intp), np.arange(len(self.decisions))
        width, jobs = self.agree.shape[1], list[IntArray]()
        while (living := at < self.decisions).any():
            rest = self.decisions - at
            rows = np.minimum(next_depth(living), rest)
            here = np.minimum(at, width - 1)
            ahead = np.where(living, self._stop[every, here] - at + 1, 0)
            counted = np.minimum(rows, ahead)
            wrong = self._wrong[every, at + counted] - self._wrong[every, at]
            total = int(counted.sum())
            note(total, total - int(wrong.sum()))
            at += counted
            jobs.append(rows)
        return np.array(jobs).reshape(len(jobs), len(at))
