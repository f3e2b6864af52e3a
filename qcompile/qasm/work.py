"""The progress of reading a program file, and its limits."""

from __future__ import annotations

from qcompile.errors import CircuitError

MAX_GATES = 1_000_000
"""The most gates of all circuits together: nested definitions can double with every line."""


class Work:
    """Counts gates, and statements of bodies; `line` is the current line.

    Every method raises CircuitError if a count would pass MAX_GATES.
    """

    def __init__(self) -> None:
        self.line = 1
        self._room = self._steps = MAX_GATES

    def require_room(self, gates: int) -> None:
        """Check that `gates` more gates are allowed."""
        if gates > self._room:
            raise CircuitError(
                f"The program has more than {MAX_GATES} gates after expansion.",
                "Check its nested gate definitions and powers.",
            )

    def take_room(self, gates: int) -> None:
        """Count `gates` more gates."""
        self.require_room(gates)
        self._room -= gates

    def step(self) -> None:
        """Count a statement of a body: statements without gates can double too."""
        self._steps -= 1
        if self._steps < 0:
            raise CircuitError(
                f"Definitions and loops expand to more than {MAX_GATES} statements.",
                "Check the nested ones.",
            )
