"""Observables in words: products of Z, by their bits."""

from __future__ import annotations

from collections.abc import Sequence


def product_words(bits: Sequence[int]) -> str:
    """<Z0 Z2> for the bits 0 and 2."""
    return f"<{' '.join(f'Z{bit}' for bit in bits)}>"
