"""Binomial counts as quantiles: the smallest k with F(k) >= u, for whole batches.

F is the distribution function of n trials of probability p. With s**2 = n p (1 - p), h = 1 - 2 p
and the normal score z of u, the Cornish-Fisher expansion of a lattice distribution (the Sheppard
correction 1/12 taken from its variance) gives, to the order 1 / s**3,

    y = n p + s z + h (z**2 - 1) / 6 + ...,    F(k) = u where y = k + 1/2 (scores.py: all terms).

So the count is y rounded, unless y lies so close to a half that the error of the expansion could
matter. There, about one count in 10**3 at 1024 shots, the decision is exact:

- where n min(p, 1 - p) is at most LARGEST_MEAN, or the expansion does not hold, by the sum of
  P(k) = P(k - 1) p / (1 - p) (n - k + 1) / k, P(0) = (1 - p)**n;
- elsewhere by the incomplete beta function, from the nearer tail.

No count approximates: rounding alone moves F, by less than 1e-13 up to a million shots.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc

from qcompile.arrays import CountArray, FloatArray, IntArray

LARGEST_MEAN = 16.0

_BLOCK = 8192
"""Counts at a time: their arrays stay within the cache, and below the size mapped anew."""
_TERMS = 65_536
"""Terms of sums at a time."""

Constant = NDArray[np.float64]
"""An array without dimensions, which numpy takes at half the cost of a scalar."""
_ONE: Constant = np.array(1.0)
_LEAST_VARIANCE: Constant = np.array(1e-9)
"""In place of less, which the bound of the error refuses just as well."""


@lru_cache(maxsize=64)
def _constants(shots: int) -> tuple[Constant, Constant]:
    """n, and the distance from a whole number within which rounding errors do not count."""
    return np.array(float(shots)), np.array(0.5 - 1e-12 - 4e-15 * shots)


def binomial_quantiles(shots: int, p: FloatArray, scores: FloatArray) -> CountArray:
    """Counts of probability `p`, (rows, circuits), from `scores`, (ARRAYS, rows, circuits).

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


def _quantiles(shots: int, p: FloatArray, scores: FloatArray) -> CountArray:
    uniform, linear, square, cubic, quartic, quintic, error = scores
    n, near = _constants(shots)
    h = _ONE - p
    v = p * h
    v *= n
    np.maximum(v, _LEAST_VARIANCE, v)
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
    h -= p
    term *= h
    y += term
    v *= v
    v *= error
    count = np.rint(y)
    np.subtract(y, count, term)
    np.abs(term, term)
    term += v
    if not (sure := term < near).all():
        doubt = (~sure).ravel().nonzero()[0]
        decided = _decisions(
            shots, p.take(doubt), uniform.take(doubt), y.take(doubt), v.take(doubt) < 0.5
        )
        count.put(doubt, decided)
    return count.astype(np.int64)


def _decisions(
    shots: int, p: FloatArray, uniform: FloatArray, y: FloatArray, holds: NDArray[np.bool_]
) -> FloatArray:
    """The quantiles of `uniform`, (m,); where `holds`, y - 1/2 is one or next to it."""
    if np.isnan(p).any():
        raise ValueError("A probability is not a number.")
    least = np.maximum(np.minimum(p, 1.0 - p), 0.0)
    sums = ~holds
    sums |= least * shots <= LARGEST_MEAN
    if sums.all():
        return quantiles_by_sums(shots, p, least, uniform)
    counts = np.empty_like(p)
    there = sums.nonzero()[0]
    counts[there] = quantiles_by_sums(shots, p[there], least[there], uniform[there])
    there = holds_only = (~sums).nonzero()[0]
    counts[holds_only] = _nearest(shots, p[there], uniform[there], np.floor(y[there]))
    return counts


def quantiles_by_sums(
    shots: int, p: FloatArray, least: FloatArray, uniform: FloatArray
) -> FloatArray:
    """The quantiles of `uniform`, (m,), from P(0), P(1), ... of the rarer outcome, `least`."""
    counts = np.empty_like(p)
    mean = shots * least.max(initial=0.0)
    terms = min(shots, int(mean + 9.0 * mean**0.5) + 12)
    height = max(1, _TERMS // max(terms, 1))
    many = p > 0.5
    tail = np.where(many, 1.0 - uniform, uniform)
    ratios = (shots + 1.0) / np.arange(1.0, terms) - 1.0
    for start in range(0, len(p), height):
        block = slice(start, start + height)
        chance = np.empty((len(p[block]), terms))
        rare = least[block]
        chance[:, :1] = np.exp(shots * np.log1p(-rare))[:, None]
        np.multiply((rare / (1.0 - rare))[:, None], ratios, chance[:, 1:])
        np.multiply.accumulate(chance, axis=1, out=chance)
        np.add.accumulate(chance, axis=1, out=chance)
        counts[block] = np.count_nonzero(chance < tail[block, None], axis=1)
    return np.where(many, shots - counts, counts)


def _nearest(shots: int, p: FloatArray, uniform: FloatArray, lower: FloatArray) -> FloatArray:
    """`lower` where F(lower) >= `uniform`, else `lower` + 1."""
    left, right = shots - lower, lower + 1.0
    upper = uniform > 0.5
    tail = betainc(
        np.where(upper, right, left), np.where(upper, left, right), np.where(upper, p, 1.0 - p)
    )
    beyond = np.where(upper, tail > 1.0 - uniform, tail < uniform)
    return np.asarray(lower + beyond)
