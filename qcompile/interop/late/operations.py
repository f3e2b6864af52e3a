"""Qiskit's own operations, told apart from others of the same name.

Source: qiskit.circuit, Operation, ControlledGate and CircuitInstruction.
"""

from __future__ import annotations

from typing import Any

from qcompile.interop.qiskit import STANDARD_GATES

DIAGONAL = ("measure", "barrier", "delay", "rzz", "cp", "crz", "cu1")
"""Instructions that commute with rotations about z of their qubits."""
ABOUT_Z = ("rz", "p", "z", "s", "sdg", "t", "tdg", "id", "u1")
"""Gates on one qubit that are rotations about z."""
_MODULES = (STANDARD_GATES, *(f"qiskit.circuit.{name}" for name in ("measure", "barrier", "delay")))
"""The modules of the operations whose names say what they do."""


def is_standard(operation: Any, *names: str) -> bool:
    """Whether the operation is Qiskit's own of one of these names, and not controlled by 0.

    Gates of users may have any name: a cz of theirs need not be diagonal.
    """
    module = getattr(operation, "base_class", type(operation)).__module__
    all_ones = (1 << getattr(operation, "num_ctrl_qubits", 0)) - 1
    return (
        operation.name in names
        and module.startswith(_MODULES)
        and getattr(operation, "ctrl_state", all_ones) == all_ones
    )


def with_angle(instruction: Any, angle: Any) -> Any:
    """An rzz instruction with another angle, and its label."""
    operation = instruction.operation
    return instruction.replace(operation=type(operation)(angle, label=operation.label))
