"""The draws of episodes in lockstep, made for many decisions at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import CircuitShots, CountArray, FloatArray, IntArray
from qcompile.streams.outcomes import outcome_counts
from qcompile.streams.quantile import binomial_quantiles
from qcompile.streams.scores import ARRAYS, equal_shots
from qcompile.streams.stream import Stream

_DECISIONS = 64
"""The most decisions in a block."""
_GROWTH = 8
"""The growth in decisions from one block to the next."""
_NUMBERS = 2_000_000
"""The most numbers in a block: 16 megabytes."""

PlaceArray = NDArray[np.int64]
Fill = Callable[[PlaceArray, PlaceArray, FloatArray], None]
"""Writes the numbers of episodes and decisions, both (rows,), to (arrays, rows, width)."""


class Draws:
    """The counts and actions of a run, from `Stream(seed, "shots")` and `Stream(seed, "actions")`.

    Draws for the same episodes, or fewer of them, at consecutive decisions come from a block drawn
    ahead, as long as the shots stay the same. All others are drawn on demand. The results are the
    same.
    """

    def __init__(self, seed: int, circuits: int):
        self.circuits = circuits
        self._counts, self._actions = Stream(seed, "shots"), Stream(seed, "actions")
        self._outcomes = Stream(seed, "outcomes")
        self._uniforms = _BlockOfDraws(self._fill_uniforms, 1, 1)
        self._shots: CircuitShots = 1
        self._scores = self._block_of_scores(self._shots)

    def actions(self, episode: PlaceArray, decision: PlaceArray) -> FloatArray:
        """A number in [0, 1) for each episode (B,) at its decision (B,)."""
        uniforms: FloatArray = self._uniforms.numbers(episode, decision)[0, :, 0].copy()
        return uniforms

    def binomial(
        self, shots: CircuitShots, p: FloatArray, episode: PlaceArray, decision: PlaceArray
    ) -> CountArray:
        """The successes among `shots` trials of probability `p`, (rows, copies * circuits).

        `episode` and `decision` are (rows, copies) integers. The circuits of each copy are numbered
        from 0, and have the same `shots`, one number or (circuits,). Otherwise as in
        `Stream.binomial`.

        Raises:
            ValueError: a probability is not a number, or shapes do not match.
        """
        if shots is not self._shots and not np.array_equal(shots, self._shots):
            self._shots, self._scores = shots, self._block_of_scores(shots)
        scores = self._scores.numbers(episode, decision)
        places = p.reshape(scores.shape[1], self.circuits)
        if not isinstance(shots, np.ndarray):
            return binomial_quantiles(shots, places, scores).reshape(p.shape)
        counts = [
            binomial_quantiles(equal, places[:, which], scores[:, :, which])
            for equal, which in equal_shots(shots)
        ]
        return np.concatenate(counts, axis=1).reshape(p.shape)

    def outcomes(
        self,
        shots: CircuitShots,
        p: FloatArray,
        episode: PlaceArray,
        decision: PlaceArray,
        first_index: IntArray,
    ) -> CountArray:
        """The counts of outcomes of probability `p`, as in `outcome_counts`."""
        return outcome_counts(self._outcomes, shots, p, episode, decision, first_index)

    def rows(self, episode: PlaceArray, decision: PlaceArray) -> RowDraws:
        """A source of counts for these places, (rows, copies), used like a Generator."""
        return RowDraws(self, episode, decision)

    def _block_of_scores(self, shots: CircuitShots) -> _BlockOfDraws:
        def fill(episode: PlaceArray, decision: PlaceArray, out: FloatArray) -> None:
            self._counts.scores(shots, episode, decision, self.circuits, out)

        return _BlockOfDraws(fill, ARRAYS, self.circuits)

    def _fill_uniforms(self, episode: PlaceArray, decision: PlaceArray, out: FloatArray) -> None:
        out[0, :, 0] = self._actions.uniforms(episode, decision)


class RowDraws(NamedTuple):
    """The draws at some episodes and decisions, both (rows, copies)."""

    draws: Draws
    episode: PlaceArray
    decision: PlaceArray

    def binomial(self, shots: CircuitShots, p: FloatArray) -> CountArray:
        """Counts for `p`, (rows, copies * circuits), as in `Draws.binomial`."""
        return self.draws.binomial(shots, p, self.episode, self.decision)

    def outcomes(
        self, shots: CircuitShots, p: FloatArray, copy: IntArray, first_index: IntArray
    ) -> CountArray:
        """Counts for `p`, (rows, circuits, 2**width), of circuits in these copies, (circuits,).

        `shots` is one number or (circuits,); `first_index` (circuits,) is as in `outcome_counts`.
        """
        episode, decision = (a.reshape(len(p), -1)[:, copy] for a in (self.episode, self.decision))
        return self.draws.outcomes(shots, p, episode, decision, first_index)


class _BlockOfDraws:
    """Numbers from `fill`, in blocks of consecutive decisions.

    A block that was used up is followed by a longer one; otherwise a block has one decision. All
    blocks use the same memory, because allocating would cost more than drawing.
    """

    def __init__(self, fill: Fill, arrays: int, width: int):
        self._fill, self._arrays, self._width = fill, arrays, width
        self._first = self._length = 0
        self._episodes = np.empty(0, dtype=np.int64)
        self._memory = np.empty(0)
        self._block = np.empty((arrays, 0, 0, width))
        self._asked = b""
        """The episodes of the last call, and the position of each in the block."""
        self._position: IntArray | None = None

    def numbers(self, episode: PlaceArray, decision: PlaceArray) -> FloatArray:
        """The numbers at the places of both arrays, flat: (arrays, places, width).

        The next call overwrites them.
        """
        episode = np.asarray(episode, dtype=np.int64)
        decision = np.asarray(decision, dtype=np.int64)
        asked, decisions = episode.tobytes(), decision.tobytes()
        size = episode.size
        if size == 0 or decisions != decisions[:8] * size:
            alone = np.empty((self._arrays, size, self._width))
            self._fill(episode.ravel(), decision.ravel(), alone)
            return alone
        offset = int(decision.flat[0]) - self._first
        if asked != self._asked or not 0 <= offset < self._length:
            offset = self._search(episode.ravel(), offset)
            self._asked = asked
        numbers = self._block[:, offset]
        return numbers if self._position is None else numbers.take(self._position, axis=1)

    def _search(self, episode: PlaceArray, offset: int) -> int:
        """Set `_position` to the positions of `episode` in the block, filling a new one if needed.

        Returns the index of the decision in the block.
        """
        if 0 <= offset < self._length:
            position = np.searchsorted(self._episodes, episode)
            position = np.minimum(position, len(self._episodes) - 1)
            if np.array_equal(self._episodes[position], episode):
                self._position = position
                return offset
        follows = offset == self._length
        self._episodes, position = np.unique(episode, return_inverse=True)
        self._position = None if np.array_equal(self._episodes, episode) else position
        self._first += offset
        episodes = len(self._episodes)
        most = min(_DECISIONS, max(1, _NUMBERS // max(1, self._arrays * self._width * episodes)))
        self._length = min(_GROWTH * self._length, most) if follows and self._length else 1
        self._fill_block(most * episodes)
        return 0

    def _fill_block(self, most_rows: int) -> None:
        """Draw all decisions of the block, in memory that holds `most_rows` rows."""
        rows = self._length * len(self._episodes)
        numbers = self._arrays * self._width
        if self._memory.size < numbers * rows:
            self._memory = np.empty(numbers * most_rows)
        block = self._memory[: numbers * rows].reshape(self._arrays, rows, self._width)
        decisions = np.arange(self._first, self._first + self._length)
        self._fill(
            np.tile(self._episodes, self._length),
            np.repeat(decisions, len(self._episodes)),
            block,
        )
        self._block = block.reshape(self._arrays, self._length, len(self._episodes), self._width)
