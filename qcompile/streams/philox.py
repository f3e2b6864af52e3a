"""Philox4x32-10 for arrays of counters (Salmon et al., SC 2011, section 3.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WordArray = NDArray[np.uint64]

RoundKeys = tuple[tuple[WordArray, WordArray], ...]
"""The two words of each round key, in the upper 32 bits of 0-dimensional arrays."""

ROUNDS = 10


def constant(value: int) -> WordArray:
    """`value` as a 0-dimensional array, which costs numpy half as much as a scalar."""
    return np.array(value, dtype=np.uint64)


THIRTY_TWO = constant(32)
_MULTIPLIERS = constant(0xD2511F53), constant(0xCD9E8D57)
_WEYL = 0x9E3779B9, 0xBB67AE85  # the golden ratio and the square root of 3, less 1


def round_keys(key: tuple[int, int]) -> RoundKeys:
    """The keys of all rounds from the two 32-bit words of `key`, a Weyl sequence for each."""
    return tuple(
        (
            constant((key[0] + step * _WEYL[0]) % 2**32 << 32),
            constant((key[1] + step * _WEYL[1]) % 2**32 << 32),
        )
        for step in range(ROUNDS)
    )


def philox(state: WordArray, keys: RoundKeys) -> WordArray:
    """The random bits of the counters in `state`, (2, n), which is overwritten.

    The four words (w0, w1, w2, w3) of a counter, and of its bits, are two numbers of 64 bits:
    state[0] = w0 * 2**32 + w1 and state[1] = w2 * 2**32 + w3. A round takes them to

        state[0] = M1 * w2 ^ (w1 ^ k0) * 2**32,     state[1] = M0 * w0 ^ (w3 ^ k1) * 2**32.

    Each step is one pass over contiguous rows. An output (the third argument) is never an operand
    too, which would take numpy three times as long for n = 1.
    """
    low, high = np.empty_like(state), np.empty_like(state)
    (state_0, state_1), (low_0, low_1), (high_0, high_1) = state, low, high
    m0, m1 = _MULTIPLIERS
    for k0, k1 in keys:
        np.left_shift(state, THIRTY_TWO, low)
        np.right_shift(state, THIRTY_TWO, high)
        np.bitwise_xor(low_0, k0, state_0)
        np.bitwise_xor(low_1, k1, state_1)
        np.multiply(high_0, m0, low_0)
        np.multiply(high_1, m1, low_1)
        np.bitwise_xor(state_0, low_1, high_0)
        np.bitwise_xor(state_1, low_0, high_1)
        state, high = high, state
        state_0, state_1, high_0, high_1 = high_0, high_1, state_0, state_1
    return state
