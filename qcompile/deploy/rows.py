"""The episode, decision and place of each row of a batch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from qcompile.arrays import IntArray


class Rows(NamedTuple):
    """The episode and decision of each row: integer arrays of one shape, counted from 0.

    `order` determines a row's copy; by default it is the episode.
    """

    episode: IntArray
    decision: IntArray
    order: IntArray | None = None

    @classmethod
    def of(cls, count: int, decision: int = 0) -> Rows:
        """Rows with one decision of each of the first `count` episodes."""
        return cls(np.arange(count), np.full(count, decision))

    def copy(self, copies: int) -> IntArray:
        """The copy in which each row is measured."""
        return (self.episode if self.order is None else self.order) % copies

    def at(self, places: IntArray) -> Rows:
        """The rows with these numbers, in any shape; -1 gives an arbitrary row."""
        return Rows(self.episode[places], self.decision[places])


def packed(rows: Rows, copies: int) -> IntArray:
    """The row number in each place, (executions, copies); -1 where a place is empty.

    A row is always measured in the copy given by its episode modulo `copies`, so an episode repeats
    alone. Within a copy rows keep their order.
    """
    copy = rows.copy(copies)
    by_copy = np.argsort(copy, kind="stable")
    counts = np.bincount(copy, minlength=copies)
    rank = np.arange(len(copy)) - np.repeat(np.cumsum(counts) - counts, counts)
    places = np.full((counts.max(initial=0), copies), -1)
    places[rank, copy[by_copy]] = by_copy
    return places


def executions(rows: Rows, copies: int) -> int:
    """The executions needed to measure the rows: the number of rows in the fullest copy."""
    if copies == 1:
        return len(rows.episode)
    return int(np.bincount(rows.copy(copies), minlength=copies).max(initial=0))
