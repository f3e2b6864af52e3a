"""The intermediate representation: immutable circuits with affine angles."""

from qcompile.ir.angle import NEGLIGIBLE_RAD, Angle
from qcompile.ir.circuit import Circuit, LateAngle
from qcompile.ir.gate import COUPLINGS, FIXED_GATES, ROTATION_GATES, Gate, Rotation
from qcompile.ir.program import Program

__all__ = [
    "COUPLINGS",
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
