"""What speculation measures, job by job, from where prediction and measurement agree.

Episodes that were played with a job for each decision, and in which it was noted whether the
predicted action was the measured one, tell the rows of every job at every depth: an episode
advances in a job to its first wrong prediction, which still counts, or by the depth, or to its end.
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
    """Where the predicted actions of some episodes are the measured ones.

    `agree` is (episodes, most decisions); of each episode the first `decisions` (episodes,) mean
    something.
    """

    agree: BoolArray
    decisions: IntArray

    @cached_property
    def _stop(self) -> IntArray:
        """For each decision the first one from it on that was predicted wrongly, or the width."""
        width = self.agree.shape[1]
        wrong = np.where(self.agree, width, np.arange(width))
        return np.asarray(np.minimum.accumulate(wrong[:, ::-1], axis=1)[:, ::-1])

    @cached_property
    def _wrong(self) -> IntArray:
        """How many decisions before each were predicted wrongly, (episodes, width + 1)."""
        zero = np.zeros((len(self.agree), 1), dtype=np.intp)
        return np.concatenate([zero, (~self.agree).cumsum(axis=1)], axis=1)

    def cut(self, decisions: int) -> Chains:
        """The same episodes, each stopped after `decisions` of its decisions."""
        return Chains(self.agree[:, :decisions], np.minimum(self.decisions, decisions))

    def take(self, episodes: IntArray) -> Chains:
        """These of the episodes, by number, some more than once perhaps."""
        return Chains(self.agree[episodes], self.decisions[episodes])

    def rows(self, depth: int) -> IntArray:
        """The rows of each episode in each job, (jobs, episodes), at most `depth` of each."""
        return self._walk(lambda living: depth, lambda compared, agreed: None)

    def rows_of(self, depth: Depth, load: Callable[[BoolArray], Workload]) -> IntArray:
        """The rows of each episode in each job, (jobs, episodes), as `depth` chooses job by job.

        `load` is that of one row of each living episode, which `living` (episodes,) says.
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
