"""Late binding: Qiskit circuits fused once, whose angles are bound for a whole batch at a time."""

from qcompile.interop.late.circuit import LateCircuit, late

__all__ = ["LateCircuit", "late"]
