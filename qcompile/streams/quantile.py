"""Binomial counts as quantiles: the smallest k with F(k) >= u, for whole batches.

F is the distribution function of n trials of probability p. With s**2 = n p (1 - p), h = 1 - 2 p
and the normal score z of u, the Cornish-Fisher expansion of a lattice distribution (the Sheppard
correction 1/12 taken from its variance) gives, to the order 1 / s**3,

    y = n p + s z + h (z**2 - 1) / 6 + ...,    F(k) = u where y = k + 1/2 (scores.py: all terms).

So the count is y rounded, unless y is so close to a half-integer that the error of the expansion
could matter. Then the decision is exact:

- where n min(p, 1 - p) is at most LARGEST_MEAN, or the expansion does not hold, by the sum of
  P(k) = P(k - 1) p / (1 - p) (n - k + 1) / k, P(0) = (1 - p)**n;
- otherwise by the incomplete beta function, from the nearer tail.

No count is approximate: only rounding affects F, by less than 1e-12.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, betaincc

from qcompile.arrays import CountArray, FloatArray

LARGEST_MEAN = 16.0
"""Up to this many expected counts the sum is faster."""

_BLOCK = 8192
"""The counts computed at a time, few enough for the cache and to reuse freed memory."""
_SUMS = 1024
"""The sums computed at a time, sorted by probability, so that they need about equal terms."""
_FEW = 128
"""Up to this many sums, function calls cost more than arithmetic."""

Constant = NDArray[np.float64]
"""A 0-dimensional array, which costs numpy half as much as a scalar."""
_ONE: Constant = np.array(1.0)
_MIN_VARIANCE: Constant = np.array(1e-9)
"""Smaller variances are replaced by this one, for which the error bound fails too."""


@lru_cache(maxsize=64)
def _constants(shots: int) -> tuple[Constant, Constant]:
    """n, and 1/2 minus the largest rounding error of y."""
    return np.array(float(shots)), np.array(0.5 - 1e-12 - 4e-15 * shots)


def binomial_quantiles(shots: int, p: FloatArray, scores: FloatArray) -> CountArray:
    """The counts for probability `p`, (rows, circuits), from `scores`, (ARRAYS, rows, circuits).

    Raises:
        ValueError: a probability is not a number.
    """
    rows, circuits = p.shape
    height = max(1, _BLOCK // max(circuits, 1))
    if rows <= height:
        return _quantiles(shots, p, scores)
    counts = np.empty(p.shape, dtype=np.int64)
    for start in range(0, rows, height):
        block = slice(start, start + height)
        counts[block] = _quantiles(shots, p[block], scores[:, block])
    return counts


def expansion(shots: int, p: FloatArray, scores: FloatArray) -> tuple[FloatArray, FloatArray]:
    """y of each count and its error bound, both (rows, circuits)."""
    _, linear, square, cubic, quartic, quintic, error = scores
    n, _ = _constants(shots)
    h = _ONE - p
    v = p * h
    v *= n
    np.maximum(v, _MIN_VARIANCE, out=v)
    s = np.sqrt(v)
    np.divide(_ONE, v, v)  # 1 / s**2 from here on
    y = p * n
    term = linear * s
    y += term
    np.multiply(quintic, v, term)
    term += cubic
    s *= v  # 1 / s from here on
    term *= s
    y += term
    np.multiply(quartic, v, term)
    term += square
    h -= p  # 1 - 2 p from here on
    term *= h
    y += term
    v *= v
    v *= error
    return y, v


def _quantiles(shots: int, p: FloatArray, scores: FloatArray) -> CountArray:
    y, error = expansion(shots, p, scores)
    count = np.rint(y)
    distance = y - count
    np.abs(distance, distance)
    distance += error
    sure = distance < _constants(shots)[1]
    if not sure.all():
        doubt = (~sure).ravel().nonzero()[0]
        places = (array.take(doubt) for array in (p, scores[0], y, error))
        count.put(doubt, _decisions(shots, *places))
    return count.astype(np.int64)


def _decisions(
    shots: int, p: FloatArray, uniform: FloatArray, y: FloatArray, error: FloatArray
) -> FloatArray:
    """The quantiles of `uniform`, (m,): floor(y) or the next integer if `error` is below 1/2."""
    least = np.minimum(p, 1.0 - p)
    largest = float(least.max())
    if math.isnan(largest):
        raise ValueError("A probability is not a number.")
    if shots * largest <= LARGEST_MEAN:
        return _by_sums(shots, p, least, uniform)
    sums = error >= 0.5
    sums |= shots * least <= LARGEST_MEAN
    counts = np.empty_like(p)
    there = (~sums).nonzero()[0]
    counts[there] = _nearest(shots, p[there], uniform[there], np.floor(y[there]))
    there = sums.nonzero()[0]
    if there.size:
        counts[there] = _by_sums(shots, p[there], least[there], uniform[there])
    return counts


def _by_sums(shots: int, p: FloatArray, least: FloatArray, uniform: FloatArray) -> FloatArray:
    """The quantiles of `uniform`, (m,), from P(0), P(1), ... of the rarer outcome, `least`.

    Less than 2**-53 of the probability lies more than nine standard deviations and twelve counts
    above the mean.
    """
    if len(p) > _SUMS:
        counts = np.empty_like(p)
        order = least.argsort()
        for start in range(0, len(p), _SUMS):
            some = order[start : start + _SUMS]
            counts[some] = _by_sums(shots, p[some], least[some], uniform[some])
        return counts
    least = np.maximum(least, 0.0)
    mean = shots * float(least.max())
    terms = min(shots, int(mean + 9.0 * math.sqrt(mean)) + 12)
    many = p > 0.5
    tail = np.where(many, 1.0 - uniform, uniform)
    chance = _ratios(shots, terms) * (least / (1.0 - least))
    chance[:1] = np.exp(shots * np.log1p(-least))
    _accumulate(np.multiply, chance)
    _accumulate(np.add, chance)
    counts = np.add.reduce(chance < tail, axis=0)
    return np.asarray(np.where(many, shots - counts, counts))


@lru_cache(maxsize=64)
def _ratios(shots: int, terms: int) -> FloatArray:
    """(n - k + 1) / k for k = 0 (meaningless), 1, ..., (terms, 1)."""
    ratios = (shots + 1.0) / np.maximum(np.arange(terms), 0.5) - 1.0
    return np.asarray(ratios[:, None])


def _accumulate(operation: np.ufunc, table: FloatArray) -> None:
    """Replace each row of `table` by the operation applied to all rows up to it."""
    if table.shape[1] <= _FEW:
        operation.accumulate(table, axis=0, out=table)
        return
    for earlier, row in pairwise(table):
        operation(earlier, row, row)


def _nearest(shots: int, p: FloatArray, uniform: FloatArray, lower: FloatArray) -> FloatArray:
    """`lower` where F(lower) >= `uniform`, else `lower` + 1."""
    above, below = lower + 1.0, shots - lower
    beyond = np.where(
        uniform > 0.5,
        betainc(above, below, p) > 1.0 - uniform,
        betaincc(above, below, p) < uniform,
    )
    return np.asarray(lower + beyond)
