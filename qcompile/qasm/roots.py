"""Powers of gates on one qubit.

A fractional power is the principal one, as Qiskit computes it: every eigenvalue exp(i w) of the
gate's matrix, w in (-pi, pi], becomes exp(i k w). So the global phase of a gate matters: the square
root of x is sx, that of rx(pi) is rx(pi/2). For a rotation of the table the angle is multiplied
instead, whatever it is: pow(k) @ rx(a) is rx(k a), pow(k) @ p(a) is p(k a).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

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

_BRANCH_CUT_RAD = math.pi * 1e-12
"""An eigenvalue this close to -1 counts as exp(i pi), from either side, as in Qiskit."""
_NO_TURN_RAD = 1e-14


def multiple(gates: Sequence[Gate], exponent: float) -> list[Gate] | None:
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


def principal(gates: Sequence[Gate], phase: Angle, exponent: float) -> tuple[list[Gate], Angle]:
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
