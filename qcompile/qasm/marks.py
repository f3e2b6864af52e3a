"""Marks: the resets, barriers and delays of a file, and their places among the gates."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Mark:
    """A statement such as `reset`, `barrier` or `delay[100ns]` on some bits of a program.

    `gates[i]` is the number of gates on bit `bits[i]` that come before it, or None where it comes
    after the measurement.
    """

    text: str
    bits: tuple[int, ...]
    gates: tuple[int | None, ...]

    @classmethod
    def at(cls, text: str, places: Iterable[tuple[int, int | None]]) -> Mark:
        """The mark on bits, each with its number of gates."""
        bits, gates = zip(*places, strict=True)
        return cls(text, bits, gates)

    @property
    def places(self) -> tuple[tuple[int, int | None], ...]:
        """Each bit with its number of gates."""
        return tuple(zip(self.bits, self.gates, strict=True))

    @property
    def word(self) -> str:
        return self.text.partition("[")[0]
