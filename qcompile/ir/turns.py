"""Large angles reduced to one turn, exactly.

cos(1e8) needs 1e8 modulo 2 pi, and the double nearest to 2 pi is off by 2.4e-16, so 16 million
turns are off by 4e-9. Large angles are therefore counted in turns, as fractions of 128 bits, with
as many bits of 1 / (2 pi) as any double needs (Payne and Hanek, 1983).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import FloatArray

MODERATE_RAD = 256.0
"""Up to here ordinary double arithmetic is good enough: one rounding is at most 3e-14."""

_MANTISSA = 53
_MIN_EXPONENT = 3 - _MANTISSA  # of an angle of 4 or more, as a whole number times a power of 2
_MAX_EXPONENT = 1024 - _MANTISSA
_LOW_32 = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)


def reduced(angles: FloatArray | float) -> FloatArray:
    """`angles` modulo 2 pi in [-pi, pi], to 1e-15, however large; those below 4 are unchanged.

    Infinities and NaN are unchanged too.
    """
    angles = np.asarray(angles, dtype=float)
    mantissa, exponent = np.frexp(angles)
    large = (np.abs(angles) >= 4.0) & np.isfinite(angles)
    whole = np.where(large, np.abs(mantissa) * 2.0**_MANTISSA, 0.0).astype(np.uint64)
    high, low = _turns_of_powers()
    index = np.where(large, exponent - _MANTISSA - _MIN_EXPONENT, 0)
    # Products modulo one turn: the bits that overflow 64 bits are whole turns.
    turns = whole * high[index] + _upper_half(whole, low[index])
    radians = turns.astype(np.int64) * (2 * math.pi / 2.0**64)
    return np.where(large, np.copysign(1.0, angles) * radians, angles)


def reduced_product(factor: FloatArray | float, values: FloatArray | float) -> FloatArray:
    """`factor * values` modulo 2 pi, as exact as `reduced`: the product is not rounded first.

    The result is NaN where the product is not finite.
    """
    mantissa_a, exponent_a = np.frexp(factor)
    mantissa_b, exponent_b = np.frexp(values)
    exponent = exponent_a + exponent_b
    with np.errstate(over="ignore", invalid="ignore"):
        product = mantissa_a * mantissa_b
        high_a, low_a = _split(mantissa_a)
        high_b, low_b = _split(mantissa_b)
        # The rounding error of the product (Dekker, 1971).
        rest = low_a * low_b - (((product - high_a * high_b) - low_a * high_b) - high_a * low_b)
        top = np.ldexp(product, exponent)
        result = reduced(top) + reduced(np.ldexp(rest, exponent))
    return np.where(np.isfinite(top), result, np.nan)


def reduced_sum(terms: Iterable[Fraction]) -> float:
    """The sum of exact numbers modulo 2 pi, to 1e-15.

    Raises:
        OverflowError: the sum is too large for a double.
    """
    total, radians = sum(terms, Fraction()), 0.0
    while True:
        part = float(total)
        radians += float(reduced(part))
        total -= Fraction(part)
        if abs(part) < 1.0:
            return radians


def _split(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Each value as a sum of two numbers of 26 bits (Veltkamp)."""
    scaled = values * (2.0**27 + 1)
    high = scaled - (scaled - values)
    return high, values - high


def _upper_half(a: NDArray[np.uint64], b: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The upper 64 bits of the 128-bit products."""
    a_high, a_low, b_high, b_low = a >> _32, a & _LOW_32, b >> _32, b & _LOW_32
    middle = a_high * b_low + (a_low * b_low >> _32)
    other = a_low * b_high + (middle & _LOW_32)
    upper: NDArray[np.uint64] = a_high * b_high + (middle >> _32) + (other >> _32)
    return upper


@cache
def _turns_of_powers() -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """2^e radians as a fraction of a turn, in two 64-bit words, for every exponent e."""
    bits = _MAX_EXPONENT + 128 + 64
    inverse = (1 << 2 * bits) // (2 * _pi(bits))  # 1 / (2 pi) times 2^bits
    words = [
        (inverse << e + 64 >> bits - 64) & ((1 << 128) - 1)
        for e in range(_MIN_EXPONENT, _MAX_EXPONENT + 1)
    ]
    split = [(word >> 64, word & ((1 << 64) - 1)) for word in words]
    high, low = np.array(split, dtype=np.uint64).T
    return high, low


def _pi(bits: int) -> int:
    """pi times 2^bits, to a few units (Machin)."""

    def arctan_inverse(n: int) -> int:
        power = total = (1 << bits) // n
        k = 1
        while power:
            power //= -n * n
            k += 2
            total += power // k
        return total

    return 16 * arctan_inverse(5) - 4 * arctan_inverse(239)
