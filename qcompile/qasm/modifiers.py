"""Gates raised to powers, inverted and controlled.

A fractional power is the principal one, as Qiskit computes it: every eigenvalue exp(i w) of the
gate's matrix, w in (-pi, pi], becomes exp(i k w). So the global phase of a gate matters: the square
root of x is sx, that of rx(pi) is rx(pi/2). For a rotation of the table the angle is multiplied
instead, whatever it is: pow(k) @ rx(a) is rx(k a), pow(k) @ p(a) is p(k a).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qcompile.errors import CircuitError
from qcompile.ir import ROTATION_GATES, Angle, Gate
from qcompile.ir.turns import reduced_product

Matrix = NDArray[np.complex128]

_ROOT = math.sqrt(0.5)
_MATRICES: dict[str, Matrix] = {
    "id": np.eye(2, dtype=complex),
    "x": np.array([[0, 1], [1, 0]], dtype=complex),
    "y": np.array([[0, -1j], [1j, 0]]),
    "z": np.diag([1, -1 + 0j]),
    "h": np.array([[_ROOT, _ROOT], [_ROOT, -_ROOT]], dtype=complex),
    "s": np.diag([1, 1j]),
    "sdg": np.diag([1, -1j]),
    "t": np.diag([1, cmath.exp(0.25j * math.pi)]),
    "tdg": np.diag([1, cmath.exp(-0.25j * math.pi)]),
    "sx": np.array([[0.5 + 0.5j, 0.5 - 0.5j], [0.5 - 0.5j, 0.5 + 0.5j]]),
    "sxdg": np.array([[0.5 - 0.5j, 0.5 + 0.5j], [0.5 + 0.5j, 0.5 - 0.5j]]),
}
_ABOUT_Z = {"z": 1.0, "s": 0.5, "t": 0.25, "sdg": -0.5, "tdg": -0.25}
"""Gates equal to p(a), and a in half turns."""

_INVERSE = {"s": "sdg", "t": "tdg", "sx": "sxdg"}
_INVERSE |= {inverse: name for name, inverse in _INVERSE.items()}

_NO_PHASE = Angle()
_BRANCH_CUT_RAD = math.pi * 1e-12
"""An eigenvalue this close to -1 counts as exp(i pi), from either side, as in Qiskit."""
_NO_TURN_RAD = 1e-14


@dataclass(frozen=True)
class Unitary:
    """The effect of a statement: the gates on each of its qubits, and the global phase they lack.

    `is_standard` if the file uses a gate of the table, whose powers multiply rotation angles.
    """

    parts: Sequence[Sequence[Gate]]
    phase: Angle = _NO_PHASE
    is_standard: bool = False

    @property
    def size(self) -> int:
        return sum(map(len, self.parts))

    def inverse(self) -> Unitary:
        return Unitary([inverse(part) for part in self.parts], -self.phase, self.is_standard)

    def multiple(self, exponent: float) -> Unitary | None:
        """The power of a rotation of the table; None for any other gate."""
        if not self.is_standard or len(self.parts) != 1:
            return None
        gates = _multiple(self.parts[0], exponent)
        return None if gates is None else Unitary([gates], self.phase * exponent, True)

    def power(self, exponent: float) -> Unitary:
        """The unitary to a real power; a whole power repeats the gates.

        Raises:
            CircuitError: the power is fractional, and the gates depend on an input or act on
                several qubits.
        """
        if exponent.is_integer():
            count = int(abs(exponent))
            one = self if exponent >= 0 else self.inverse()
            parts = [list(part) * count if part else [] for part in one.parts]
            return Unitary(parts, one.phase * count)
        used = [i for i, part in enumerate(self.parts) if part]
        if len(used) > 1:
            raise CircuitError(
                f"pow({exponent:g}) of a gate on several qubits may entangle them.",
                "Only whole powers of such a gate are supported.",
            )
        gates = self.parts[used[0]] if used else ()
        power, phase = _principal(gates, self.phase, exponent)
        return Unitary([power if [i] == used else [] for i in range(len(self.parts))], phase)

    def controlled(self, *, on_one: bool) -> Unitary:
        """The phase applied if a control qubit is 1, or 0: a gate on that qubit."""
        if on_one:
            return Unitary([[Gate("p", self.phase)]])
        return Unitary([[Gate("p", -self.phase)]], self.phase)


def inverse(gates: Sequence[Gate]) -> list[Gate]:
    """The gates that undo `gates`."""
    return [
        Gate(_INVERSE.get(gate.name, gate.name), gate.angle and -gate.angle)
        for gate in reversed(gates)
    ]


def _multiple(gates: Sequence[Gate], exponent: float) -> list[Gate] | None:
    """The power of one rotation, or of one about an axis in the xy plane, as `r` builds it."""
    names = tuple(gate.name for gate in gates)
    if names == ("rz", "rx", "rz"):
        before, turn, after = gates
        return [before, Gate("rx", _times(turn.angle, exponent)), after]
    if len(gates) != 1:
        return None
    name, angle = gates[0].name, gates[0].angle
    if name in ROTATION_GATES:
        return [Gate(name, _times(angle, exponent))]
    if name in _ABOUT_Z and not exponent.is_integer():
        return [Gate("p", Angle(_ABOUT_Z[name] * exponent * math.pi))]
    return None


def _times(angle: Angle | None, exponent: float) -> Angle:
    """`angle * exponent`, with a large constant reduced exactly."""
    assert angle is not None
    product = angle * exponent
    if product.moderate() is product:
        return product
    constant = float(reduced_product(angle.constant, exponent))
    return Angle(constant, product.terms)


def _principal(gates: Sequence[Gate], phase: Angle, exponent: float) -> tuple[list[Gate], Angle]:
    """The gates of the principal power, and the global phase they lack."""
    angles = [phase, *(gate.angle for gate in gates if gate.angle is not None)]
    if not all(angle.is_constant for angle in angles):
        raise CircuitError(
            f"pow({exponent:g}) of a gate that depends on an input is not supported.",
            "Use a whole power, or a power of rx, ry, rz, p or r.",
        )
    matrix = np.eye(2, dtype=complex) * cmath.exp(1j * phase.constant)
    for gate in gates:
        matrix = _matrix(gate) @ matrix
    middle = cmath.phase(np.linalg.det(matrix)) / 2
    rotation = matrix * cmath.exp(-1j * middle)
    # rotation = cos(a) - i sin(a) (x X + y Y + z Z)
    cos, z = rotation[0, 0].real, -rotation[0, 0].imag
    y, x = rotation[1, 0].real, -rotation[1, 0].imag
    half = math.atan2(math.hypot(x, y, z), cos)
    low, high = _principal_angle(middle - half), _principal_angle(middle + half)
    about = exponent * (high - low)
    return _rotation(about, (x, y, z)), Angle(exponent * (high + low) / 2)


def _rotation(angle: float, axis: tuple[float, float, float]) -> list[Gate]:
    """The rotation about any axis, of any length."""
    if abs(angle) <= _NO_TURN_RAD:
        return []
    x, y, z = axis
    for name, along, across in (
        ("rx", x, math.hypot(y, z)),
        ("ry", y, math.hypot(x, z)),
        ("rz", z, math.hypot(x, y)),
    ):
        if across <= _NO_TURN_RAD * abs(along):
            return [Gate(name, Angle(math.copysign(1.0, along) * angle))]
    tilt, turn = math.atan2(math.hypot(x, y), z), math.atan2(y, x)
    gates = (("rz", -turn), ("ry", -tilt), ("rz", angle), ("ry", tilt), ("rz", turn))
    return [Gate(name, Angle(by)) for name, by in gates if by]


def _principal_angle(angle: float) -> float:
    angle = math.remainder(angle, 2 * math.pi)
    return angle + 2 * math.pi if angle <= -math.pi + _BRANCH_CUT_RAD else angle


def _matrix(gate: Gate) -> Matrix:
    if gate.angle is None:
        return _MATRICES[gate.name]
    angle = gate.angle.constant
    cos, sin = math.cos(angle / 2), math.sin(angle / 2)
    match gate.name:
        case "p":
            return np.diag([1, cmath.exp(1j * angle)])
        case "rz":
            return np.diag([complex(cos, -sin), complex(cos, sin)])
        case "ry":
            return np.array([[cos, -sin], [sin, cos]], dtype=complex)
    return np.array([[cos, -1j * sin], [-1j * sin, cos]])
