"""Which decision of which episode the rows of a batch are, and where each is measured."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qcompile.arrays import IntArray


class Rows(NamedTuple):
    """The episode and the decision of each row, two integer arrays of one shape, both from 0.

    `order` is what a row's copy follows from: its episode, unless it is said otherwise.
    """

    episode: IntArray
    decision: IntArray
    order: IntArray | None = None

    @classmethod
    def of(cls, count: int, decision: int = 0) -> Rows:
        """One decision of each of the first `count` episodes."""
        return cls(np.arange(count), np.full(count, decision))

    def copy(self, copies: int) -> IntArray:
        """The number of the copy that each row is measured in."""
        return (self.episode if self.order is None else self.order) % copies

    def at(self, places: IntArray) -> Rows:
        """The rows by number, in any shape; where that is -1 it does not matter which."""
        return Rows(self.episode[places], self.decision[places])


def packed(rows: Rows, copies: int) -> IntArray:
    """The numbers of the rows in each place, (executions, copies), -1 where a place is empty.

    A row is always measured in the copy of its episode, episode modulo `copies`, whatever else is
    measured: so an episode repeats alone. Within a copy rows come in their order.
    """
    copy = rows.copy(copies)
    by_copy = np.argsort(copy, kind="stable")
    counts = np.bincount(copy, minlength=copies)
    rank = np.arange(len(copy)) - np.repeat(np.cumsum(counts) - counts, counts)
    places = np.full((counts.max(initial=0), copies), -1)
    places[rank, copy[by_copy]] = by_copy
    return places


def executions(rows: Rows, copies: int) -> int:
    """How many executions it takes to measure the rows: those of the fullest copy."""
    if copies == 1:
        return len(rows.episode)
    return int(np.bincount(rows.copy(copies), minlength=copies).max(initial=0))
