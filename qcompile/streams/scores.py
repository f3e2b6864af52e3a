"""Normal scores: the part of a count that does not depend on its probability.

A count is the quantile of a uniform number u. With z the normal score of u, Phi(z) = u, its
Cornish-Fisher expansion (quantile.py) needs u, polynomials of z and an error bound. These are the
seven arrays of this file, and can be drawn long before the probabilities are known.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.special import ndtri

from qcompile.arrays import CircuitShots, FloatArray
from qcompile.streams.philox import RoundKeys, WordArray, constant, philox

ARRAYS = 7
"""u; polynomials, times s, h, 1 / s, h / s**2 and 1 / s**3; the error bound, times 1 / s**4."""

ERROR = 0.112, 0.008
"""The expansion is wrong by less than (0.112 + 0.008 z**6) / s**4, s**2 = n p (1 - p).

That is at least four times the largest error wherever it is less than 1/2, by comparison of the
expansion at Phi(z) = F(k) with k + 1/2, for all k with |z| < 8.2 (3000 of them for large n),
n = 2 to 64, 128, 256, 1024, 8192, 10**5 and 10**7, and 180 probabilities for each n.
tests/streams/test_quantile.py repeats part of the comparison.
"""

_BLOCK = 16_000
"""The counts computed at a time: their arrays stay below 128 KiB, where malloc starts to mmap."""

_ELEVEN, _ODD = constant(11), constant(1)
_SCALE = np.array(2.0**-53)


def equal_shots(shots: CircuitShots) -> list[tuple[int, slice]]:
    """The groups of neighbouring circuits with equal shots: the shots, and the circuits."""
    if not isinstance(shots, np.ndarray):
        return [(shots, slice(None))]
    borders = [0, *(np.flatnonzero(np.diff(shots)) + 1).tolist(), len(shots)]
    return [(int(shots[start]), slice(start, stop)) for start, stop in pairwise(borders)]


def fill_scores(shots: CircuitShots, row: WordArray, keys: RoundKeys, scores: FloatArray) -> None:
    """Fill `scores` (ARRAYS, rows, circuits), the arrays for counts in `shots` shots.

    `row` (rows,) holds episode * 2**32 + decision. u is an odd multiple of 2**-53, so that neither
    u nor 1 - u is ever 0. For circuit c it has 52 bits of number c % 2 of the counter (episode,
    decision, c // 2, 0).
    """
    alike = equal_shots(shots)
    height = max(1, _BLOCK // max(scores.shape[2], 1))
    for start in range(0, len(row), height):
        block = scores[:, start : start + height]
        _uniforms(row[start : start + height], keys, block[0])
        for equal, which in alike:
            polynomials(equal, block[:, :, which])


def _uniforms(row: WordArray, keys: RoundKeys, uniform: FloatArray) -> None:
    circuits = uniform.shape[1]
    state = np.empty((2, len(row), (circuits + 1) // 2), dtype=np.uint64)
    state[0] = row[:, None]
    state[1] = np.arange(state.shape[2], dtype=np.uint64) << np.uint64(32)
    bits = philox(state.reshape(2, -1), keys).reshape(state.shape)
    bits >>= _ELEVEN
    bits |= _ODD
    np.multiply(bits[0], _SCALE, uniform[:, ::2])
    np.multiply(bits[1, :, : circuits // 2], _SCALE, uniform[:, 1::2])


def polynomials(shots: int, block: FloatArray) -> None:
    """Fill all arrays of `block`, (ARRAYS, ...), except the first, which holds u.

    For n `shots`, with w = p (1 - p) = s**2 / n and h = 1 - 2 p, the expansion has the terms

        s z + h (z**2 - 1) / 6 - (z**3 + 2 z + 2 w (z**3 - 7 z)) / (72 s)
        + h (3 z**4 + 7 z**2 - 16) (2 + w) / (1620 s**2)
        - (207 z**5 + 548 z**3 - 2684 z - 4 w (117 z**5 + 403 z**3 - 1354 z)
           - 4 w**2 (9 z**5 + 256 z**3 - 433 z)) / (155520 s**3).

    Here w / s, w / s**2, w / s**3 and w**2 / s**3 are s / n, 1 / n, 1 / (n s) and s / n**2.
    """
    uniform, linear, square, cubic, quartic, quintic, error = block
    inverse = 1.0 / max(shots, 1)
    z = ndtri(uniform)
    z2 = z * z
    first, second = inverse / 36, inverse**2 / 38880
    _even(z2, (1 + 7 * first - 433 * second, 256 * second - first, 9 * second), linear)
    linear *= z
    half = inverse / 1620
    _even(z2, (-1 / 6 - 16 * half, 1 / 6 + 7 * half, 3 * half), square)
    third = inverse / 38880
    _even(z2, (-1 / 36 - 1354 * third, 403 * third - 1 / 72, 117 * third), cubic)
    cubic *= z
    _even(z2, (-16 / 810, 7 / 810, 3 / 810), quartic)
    _even(z2, (2684 / 155520, -548 / 155520, -207 / 155520), quintic)
    quintic *= z
    np.multiply(z2, z2, error)
    error *= z2
    error *= ERROR[1]
    error += ERROR[0]


def _even(z2: FloatArray, coefficients: tuple[float, float, float], out: FloatArray) -> None:
    np.multiply(z2, coefficients[2], out)
    out += coefficients[1]
    out *= z2
    out += coefficients[0]
