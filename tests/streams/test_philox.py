"""Philox against its published vectors."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.streams.philox import philox, round_keys

KNOWN = (
    ("00000000 00000000 00000000 00000000", "00000000 00000000",
     "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff",
     "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0",
     "d16cfe09 94fdcceb 5001e420 24126ea1"),
)  # fmt: skip
"""Counter, key and random words of Random123's kat_vectors for philox4x32 with ten rounds."""


@pytest.mark.parametrize(("counter", "key", "words"), KNOWN, ids=["zeros", "ones", "pi"])
@pytest.mark.parametrize("size", [1, 2, 100])
def test_the_published_vectors(counter: str, key: str, words: str, size: int) -> None:
    w0, w1, w2, w3 = (int(word, 16) for word in counter.split())
    state = np.zeros((2, size), dtype=np.uint64)
    state[:, -1] = w0 << 32 | w1, w2 << 32 | w3
    first, second = (int(word, 16) for word in key.split())
    bits = philox(state, round_keys((first, second)))[:, -1]
    assert "".join(f"{number:016x}" for number in bits.tolist()) == words.replace(" ", "")
