"""Exact binomial counts from counters, for whole batches.

With n shots and s = min(p, 1 - p), successes of probability s are drawn

- by inversion where n s < 10 or n <= MOST_TERMS: the smallest k whose cumulative probability
  exceeds a uniform number, from the recurrence
  P(k) = P(k - 1) s / (1 - s) (n - k + 1) / k, P(0) = (1 - s)**n;
- elsewhere by Hörmann's BTRS (1993): attempts of two uniform numbers each. Two comparisons accept
  most of them, the binomial coefficients decide on the others, and one in four to eight is refused.

Neither approximates: rounding alone moves probabilities, by less than 1e-9 of themselves up to
MOST_TABLED shots and 1e-6 at ten million.

Every step treats each element by itself, so no count depends on its batch. Blocks keep arrays
within the processor's cache, and below the size that is mapped anew at each allocation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import CountArray, FloatArray
from qcompile.streams.coefficients import MOST_TERMS, log_coefficients, term_ratios
from qcompile.streams.philox import RoundKeys, WordArray, constant, philox

IndexArray = NDArray[np.intp]

_LEAST_MEAN = 10.0
"""BTRS holds from here on."""

_BLOCK = 8100
"""Elements; two numbers of 64 bits for each of them stay below malloc's 128 KiB."""
_FEW = 512
"""Up to so many elements calls cost more than numbers: `_TRIES` attempts are made at a time."""
_TRIES = 4
_STEPS = np.zeros((2, _TRIES, 1), dtype=np.uint64)
_STEPS[1, :, 0] = range(_TRIES)

_ELEVEN, _TWELVE = constant(11), constant(12)
_ONE_BITS = constant(0x3FF0000000000000)
"""The bits of 1.0. With 52 random bits in its mantissa it becomes a number in [1, 2)."""


class _Draws(NamedTuple):
    """Counts to draw: their flat indices (n,), s = min(p, 1 - p) (n,), counters (2, n)."""

    where: IndexArray
    least: FloatArray
    place: WordArray

    def take(self, which: IndexArray) -> _Draws:
        return _Draws(self.where.take(which), self.least.take(which), self.place.take(which, 1))


def binomial(
    shots: int, p: FloatArray, row: WordArray, column: WordArray, keys: RoundKeys
) -> CountArray:
    """Counts of probability `p`, (B, C), with counters of `row`, (B,), and `column`, (C,).

    The low 32 bits of `column` are 0: they count attempts.

    Raises:
        ValueError: a probability is not a number.
    """
    counts = np.empty(p.size, dtype=np.int64)
    small, refused = [], []
    height = max(1, _BLOCK // max(p.shape[1], 1))
    for start in range(0, len(p), height):
        block = slice(start, start + height)
        draws = _draws(p[block], row[block], column, start * p.shape[1])
        large = draws.least * shots >= (_LEAST_MEAN if shots > MOST_TERMS else np.inf)
        found = np.count_nonzero(large)
        if found == 0:
            _invert(shots, draws, keys, counts)
            continue
        if found < large.size:
            small.append(draws.take((~large).nonzero()[0]))
            draws = draws.take(large.nonzero()[0])
        rest = _attempt(shots, draws, keys, counts)
        if rest.where.size:
            refused.append(rest)
    if small:
        _invert(shots, _together(small), keys, counts)
    if refused:
        rest = _together(refused)
        while rest.where.size:
            rest = _attempt(shots, rest, keys, counts)
    np.subtract(shots, counts, out=counts, where=p.ravel() > 0.5)
    return counts.reshape(p.shape)


def _together(draws: list[_Draws]) -> _Draws:
    return _Draws(*(np.concatenate(parts, axis=-1) for parts in zip(*draws, strict=True)))


def _draws(p: FloatArray, row: WordArray, column: WordArray, start: int) -> _Draws:
    place = np.empty((2, *p.shape), dtype=np.uint64)
    place[0], place[1] = row[:, None], column
    least = 1.0 - p
    np.minimum(least, p, out=least)
    np.maximum(least, 0.0, out=least)
    return _Draws(np.arange(start, start + p.size), least.ravel(), place.reshape(2, -1))


def _invert(shots: int, draws: _Draws, keys: RoundKeys, counts: CountArray) -> None:
    """Fill `counts` where `draws` say, by inversion."""
    where, least, place = draws
    if np.count_nonzero(np.isnan(least)):
        raise ValueError("A probability is not a number.")
    uniform = (philox(place.copy(), keys)[0] >> _ELEVEN) * 2.0**-53
    odds = least / (1.0 - least)
    term = np.exp(shots * np.log1p(-least))
    reached = term.copy()
    count = np.zeros(least.size, dtype=np.uint8)
    beyond = np.empty(least.size, dtype=bool)
    factor = np.empty_like(odds)
    for ratio in term_ratios(shots):
        np.greater_equal(uniform, reached, beyond)
        left = np.count_nonzero(beyond)
        if left == 0:
            break
        if left < 0.7 * beyond.size and beyond.size > _FEW:
            counts[where] = count
            rest = beyond.nonzero()[0]
            where, count, uniform = where.take(rest), count.take(rest), uniform.take(rest)
            odds, term, reached = odds.take(rest), term.take(rest), reached.take(rest)
            beyond, factor = beyond.take(rest), np.empty_like(odds)
        np.add(count, beyond.view(np.uint8), count)
        np.multiply(odds, ratio, factor)
        np.multiply(term, factor, term)
        np.add(reached, term, reached)
    counts[where] = count


def _attempt(shots: int, draws: _Draws, keys: RoundKeys, counts: CountArray) -> _Draws:
    """Fill `counts` where `draws` say, each by the first of its attempts that is accepted.

    Return the draws all of whose attempts were refused, with the counters of their next ones.
    """
    where, least, place = draws
    tries = _TRIES if least.size <= _FEW else 1
    state = place[:, None] + _STEPS[:, :tries]
    bits = philox(state.reshape(2, -1), keys)
    bits >>= _TWELVE
    bits |= _ONE_BITS
    u, v = bits.view(np.float64).reshape(2, tries, -1)
    u -= 1.5  # in [-1/2, 1/2)
    np.subtract(2.0, v, v)  # in (0, 1]

    mean = least * shots
    spread = np.sqrt(mean * (1.0 - least))
    b = 2.53 * spread
    b += 1.15
    twice_a = 0.0496 * b
    twice_a += 0.02 * least
    twice_a -= 0.1746
    us = np.abs(u)
    np.subtract(0.5 + 2.0**-53, us, us)  # never 0
    k = twice_a / us
    k += b
    k *= u
    k += mean + 0.5
    np.floor(k, k)
    accepted = us >= 0.07
    accepted &= v <= 0.92 - 4.2 / b

    hard = (~accepted).ravel().nonzero()[0]
    draw = hard % least.size if tries > 1 else hard
    accepted.put(
        hard,
        _accepted(
            shots,
            k.take(hard),
            us.take(hard),
            v.take(hard),
            least.take(draw),
            spread.take(draw),
            b.take(draw),
            twice_a.take(draw),
        ),
    )
    count = k[-1]
    for step in range(tries - 2, -1, -1):
        np.copyto(count, k[step], where=accepted[step])
    counts[where] = count
    rest = draws.take((~np.logical_or.reduce(accepted, axis=0)).nonzero()[0])
    rest.place[1] += np.uint64(tries)
    return rest


def _accepted(
    shots: int,
    k: FloatArray,
    us: FloatArray,
    v: FloatArray,
    least: FloatArray,
    spread: FloatArray,
    b: FloatArray,
    twice_a: FloatArray,
) -> NDArray[np.bool_]:
    """Whether v lies below the ratio of the probability of `k` to its hat."""
    inside = np.minimum(np.maximum(k, 0.0), float(shots))
    hat = twice_a / (us * us)
    hat *= 0.5
    hat += b
    v *= (2.83 + 5.1 / b) * spread
    v /= hat
    mode = np.floor((shots + 1) * least)
    bound = np.log(least / (1.0 - least))
    bound *= inside - mode
    bound += log_coefficients(shots, inside)
    bound -= log_coefficients(shots, mode)
    return np.asarray((np.log(v) <= bound) & (inside == k))
