"""Binomial coefficients, as far as draws need them."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from qcompile.arrays import FloatArray

MOST_TABLED = 65_536
"""Shots of a table, which is half a megabyte."""

MOST_TERMS = 64
"""Terms of an inversion. Up to so many shots it is the faster way for every probability; beyond,
where the mean is below 10, more successes have less than 2**-53 of the probability."""

_SMALL = np.array([math.log(math.factorial(k)) for k in range(16)])


def log_factorial(k: FloatArray) -> FloatArray:
    """The logarithm of k! for whole numbers `k`, to 1e-15 of itself: Stirling's series from 16."""
    x = np.maximum(k, 16.0)
    inverse = 1.0 / (x * x)
    series = (1 / 12 - (1 / 360 - (1 / 1260 - inverse / 1680) * inverse) * inverse) / x
    series += (x + 0.5) * np.log(x) - x + 0.5 * math.log(2 * math.pi)
    return np.where(k < 16, _SMALL.take(np.minimum(k, 15.0).astype(np.int64)), series)


def log_coefficients(shots: int, k: FloatArray) -> FloatArray:
    """The logarithm of `shots` over `k`, less that of the factorial of `shots`.

    `k` holds whole numbers in [0, shots].
    """
    if shots > MOST_TABLED:
        return np.asarray(-(log_factorial(k) + log_factorial(shots - k)))
    return _table(shots).take(k.astype(np.int64))


@lru_cache(maxsize=16)
def _table(shots: int) -> FloatArray:
    logs = log_factorial(np.arange(shots + 1.0))
    return np.asarray(-(logs + logs[::-1]))


@lru_cache(maxsize=16)
def term_ratios(shots: int) -> tuple[FloatArray, ...]:
    """(n - k + 1) / k for n shots and k = 1, 2, ..., as arrays without dimensions."""
    return tuple(np.array((shots - k + 1) / k) for k in range(1, min(shots, MOST_TERMS) + 1))
