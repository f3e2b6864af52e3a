"""Where the reading of a program file is, and how much more of it may be written out."""

from __future__ import annotations

from qcompile.errors import CircuitError

MAX_GATES = 1_000_000
"""Gates of all circuits. Nested definitions double with every line; more are not written out."""


class Work:
    """`line` is the line that is read; gates and statements of bodies are counted.

    Every method raises CircuitError where there would be more than MAX_GATES of them.
    """

    def __init__(self) -> None:
        self.line = 1
        self._room = self._steps = MAX_GATES

    def require_room(self, gates: int) -> None:
        """Nothing, if so many gates more can be written out."""
        if gates > self._room:
            raise CircuitError(
                f"The program has more than {MAX_GATES} gates when it is written out.",
                "Check its nested gate definitions and powers.",
            )

    def take_room(self, gates: int) -> None:
        """Count gates that are written out."""
        self.require_room(gates)
        self._room -= gates

    def step(self) -> None:
        """Count a statement of a body: those without gates double too."""
        self._steps -= 1
        if self._steps < 0:
            raise CircuitError(
                f"Definitions and loops take more than {MAX_GATES} statements to write out.",
                "Check those that nest.",
            )
