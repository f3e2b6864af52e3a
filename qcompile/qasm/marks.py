"""Marks: the resets, barriers and delays of a file, and their places among the gates."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mark:
    """A statement such as `reset`, `barrier` or `delay[100ns]` on some circuits.

    `gates[i]` is the number of gates of circuit `circuits[i]` that come before it, or None where it
    comes after the measurement.
    """

    text: str
    circuits: tuple[int, ...]
    gates: tuple[int | None, ...]

    @property
    def word(self) -> str:
        return self.text.partition("[")[0]
