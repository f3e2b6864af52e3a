"""Observables, bits and gates of circuits in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence


def product_words(bits: Sequence[int]) -> str:
    """<Z0 Z2> for the bits 0 and 2."""
    return f"<{' '.join(f'Z{bit}' for bit in bits)}>"


def numbers(several: Sequence[int]) -> str:
    """0 2 3."""
    return " ".join(map(str, several))


def gate_words(gates: Mapping[str, int]) -> str:
    """13 rz + 12 sx."""
    return " + ".join(f"{number} {gate}" for gate, number in gates.items()) or "no gate"
