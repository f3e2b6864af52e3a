"""The gate table: every one-qubit gate as rotations about z and y, and the couplings.

Rz(a) = exp(-i a Z/2), likewise Rx and Ry; sx = exp(i pi/4) Rx(pi/2). Up to global phase every gate
of the table is a short run of z and y rotations, because Rx(a) = Rz(-pi/2) Ry(a) Rz(pi/2) and
h = Ry(pi/2) Rz(pi) (operators, the right one acts first).

A coupling acts on two qubits. On (control, target), cx = |0><0| I + |1><1| X, cz the same
with Z, and ecr = (I X - X Y) / sqrt(2) with the target's factor first: an echoed rotation of the
target about x, in a direction that the control decides. It takes Rz(a) on its control to Rz(-a).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from qcompile.catalogue import close_names
from qcompile.errors import CircuitError
from qcompile.ir.angle import Angle

Axis = Literal["z", "y"]
Rotation = tuple[Axis, Angle]

_PI, _HALF_PI, _QUARTER_PI = Angle(math.pi), Angle(math.pi / 2), Angle(math.pi / 4)


def _rx(angle: Angle) -> tuple[Rotation, ...]:
    return (("z", _HALF_PI), ("y", angle), ("z", -_HALF_PI))


def _ry(angle: Angle) -> tuple[Rotation, ...]:
    return (("y", angle),)


def _rz(angle: Angle) -> tuple[Rotation, ...]:
    return (("z", angle),)


FIXED_GATES: dict[str, tuple[Rotation, ...]] = {
    "id": (),
    "x": (("z", _PI), ("y", _PI)),
    "y": _ry(_PI),
    "z": _rz(_PI),
    "h": (("z", _PI), ("y", _HALF_PI)),
    "s": _rz(_HALF_PI),
    "sdg": _rz(-_HALF_PI),
    "t": _rz(_QUARTER_PI),
    "tdg": _rz(-_QUARTER_PI),
    "sx": _rx(_HALF_PI),
    "sxdg": _rx(-_HALF_PI),
}
"""Gates without an angle: name to rotations, the first acts first."""

ROTATION_GATES: dict[str, Callable[[Angle], tuple[Rotation, ...]]] = {
    "rx": _rx,
    "ry": _ry,
    "rz": _rz,
    "p": _rz,
}
"""Gates with one angle: name to a function from the angle to rotations."""

COUPLINGS = ("cx", "cz", "ecr")
"""The gates on two qubits, (control, target); cz treats both alike."""


@dataclass(frozen=True, slots=True)
class Gate:
    """One gate of a circuit: a name of the gate table, its angle if it has one, and its qubits.

    Raises:
        CircuitError: the name is not in the table, the angle is missing or not allowed, or the
            qubits are not as many different ones as the gate has.
    """

    name: str
    angle: Angle | None = None
    qubits: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        if self.name in FIXED_GATES or self.name in COUPLINGS:
            if self.angle is not None:
                raise CircuitError(f"Gate {self.name!r} takes no angle.", f"Found {self.angle}.")
        elif self.name in ROTATION_GATES:
            if self.angle is None:
                raise CircuitError(f"Gate {self.name!r} needs an angle.")
        else:
            known = [*FIXED_GATES, *ROTATION_GATES, *COUPLINGS]
            near = close_names(self.name, known)
            raise CircuitError(
                f"Unknown gate {self.name!r}.",
                f"Known gates: {' '.join(known)}.",
                *([f"Did you mean {' or '.join(near)}?"] if near else []),
            )
        if len(self.qubits) != 1 or self.name in COUPLINGS:
            self._check_qubits()

    def _check_qubits(self) -> None:
        count = 2 if self.name in COUPLINGS else 1
        if len(self.qubits) != count:
            needed = "two qubits" if count == 2 else "one qubit"
            raise CircuitError(f"Gate {self.name!r} acts on {needed}, not {len(self.qubits)}.")
        if len(set(self.qubits)) < count:
            raise CircuitError(f"Gate {self.name!r} acts on qubit {self.qubits[0]} twice.")

    @classmethod
    def of(
        cls, name: str, angle: Angle | float | str | None = None, *, qubits: tuple[int, ...] = (0,)
    ) -> Gate:
        """The gate `name`, its angle given as a number, a text or an Angle."""
        return cls(name, None if angle is None else Angle.of(angle), qubits)

    @property
    def is_coupling(self) -> bool:
        """Whether it acts on two qubits."""
        return len(self.qubits) == 2

    def on(self, *qubits: int) -> Gate:
        """The same gate on other qubits."""
        return Gate(self.name, self.angle, qubits)

    @property
    def rotations(self) -> tuple[Rotation, ...]:
        """The z and y rotations equal to a one-qubit gate, up to global phase, in order."""
        if self.angle is None:
            return FIXED_GATES[self.name]
        return ROTATION_GATES[self.name](self.angle)

    def to_text(self, width: int = 1) -> str:
        """The text form: ry(x0), or in a circuit on more than one qubit ry(x0)@1 and cz@0,1."""
        text = self.name if self.angle is None else f"{self.name}({self.angle})"
        return text if width == 1 else f"{text}@{','.join(map(str, self.qubits))}"

    def __str__(self) -> str:
        return self.to_text(1 if self.qubits == (0,) else 2)
