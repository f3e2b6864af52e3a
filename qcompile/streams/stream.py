"""Streams: the purpose and place of a draw, as keys and counters of Philox."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from qcompile.arrays import CircuitShots, CountArray, FloatArray
from qcompile.streams.philox import THIRTY_TWO, RoundKeys, WordArray, constant, philox, round_keys
from qcompile.streams.quantile import binomial_quantiles
from qcompile.streams.scores import ARRAYS, fill_scores

Purpose = Literal["shots", "actions", "outcomes"]
"""The purpose of a stream. Their order determines the numbers: add new ones at the end."""

_UNIFORM = constant(0xFFFFFFFF)
"""The attempt in the counters of uniforms: no count has this many, so no counter is shared."""
_ELEVEN = constant(11)


@dataclass(frozen=True)
class Stream:
    """Draws keyed by `seed`, any integer from 0, by `purpose`, and by the place of each draw.

    Streams with different seeds or purposes are independent.
    """

    seed: int
    purpose: Purpose
    _keys: RoundKeys = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        number = get_args(Purpose).index(self.purpose)
        sequence = np.random.SeedSequence(self.seed, spawn_key=(number,))
        first, second = map(int, sequence.generate_state(2))
        object.__setattr__(self, "_keys", round_keys((first, second)))

    def uniforms(self, episode: ArrayLike, decision: ArrayLike, index: ArrayLike = 0) -> FloatArray:
        """Numbers in [0, 1), multiples of 2**-53, one for each (episode, decision, index).

        The three are integers whose shapes broadcast to the shape of the result: (B,) episodes and
        decisions give (B,).
        """
        row, column = _pair(episode, decision), _pair(index, _UNIFORM)
        shape = np.broadcast_shapes(row.shape, column.shape)
        state = np.empty((2, *shape), dtype=np.uint64)
        state[0], state[1] = row, column
        bits = philox(state.reshape(2, -1), self._keys)[0]
        return np.asarray((bits >> _ELEVEN) * 2.0**-53).reshape(shape)

    def scores(
        self,
        shots: CircuitShots,
        episode: ArrayLike,
        decision: ArrayLike,
        circuits: int,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """The scores for counts of `shots` shots, (ARRAYS, B, circuits); see scores.py.

        `episode` and `decision` are (B,) integers. The result is written to `out`, if given.
        """
        row = _pair(episode, decision)
        scores = np.empty((ARRAYS, len(row), circuits)) if out is None else out
        fill_scores(shots, row, self._keys, scores)
        return scores

    def binomial(
        self, shots: int, p: FloatArray, episode: ArrayLike, decision: ArrayLike
    ) -> CountArray:
        """The successes in `shots` trials with probability `p`, (B, circuits).

        `episode` and `decision` are (B,) integers. A count has exactly the binomial distribution,
        increases with p, and depends only on its shots, p, episode, decision and circuit.
        Probabilities outside [0, 1] count as 0 or 1.

        Raises:
            ValueError: a probability is not a number.
        """
        p = np.asarray(p, dtype=np.float64)
        return binomial_quantiles(shots, p, self.scores(shots, episode, decision, p.shape[1]))


def _pair(upper: ArrayLike, lower: ArrayLike) -> WordArray:
    """Two 32-bit words, each modulo 2**32, as one 64-bit word."""
    word = np.asarray(upper).astype(np.uint64) << THIRTY_TWO
    return np.asarray(word | np.asarray(lower).astype(np.uint32))
