"""The intermediate representation: immutable circuits of one qubit with affine angles."""

from qcompile.ir.angle import NEGLIGIBLE_RAD, Angle
from qcompile.ir.circuit import Circuit, LateAngle, Program
from qcompile.ir.gate import FIXED_GATES, ROTATION_GATES, Gate, Rotation

__all__ = [
    "FIXED_GATES",
    "NEGLIGIBLE_RAD",
    "ROTATION_GATES",
    "Angle",
    "Circuit",
    "Gate",
    "LateAngle",
    "Program",
    "Rotation",
]
