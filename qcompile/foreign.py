"""Recognising objects of other packages by the names of their classes, without importing them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

_CIRCUITS = {
    ("qiskit", "QuantumCircuit"): ("a Qiskit circuit", "Use Program.from_qiskit(circuit)."),
    ("pennylane", "QNode"): (
        "a PennyLane QNode",
        "Use Program.from_pennylane(qnode, inputs=2, parameters=3).",
    ),
    ("pennylane", "QuantumScript"): ("a PennyLane tape", "Use Program.from_pennylane(tape)."),
    ("cirq", "Circuit"): ("a Cirq circuit", "Use Program.from_qasm(circuit.to_qasm())."),
}


def _class_paths(value: object) -> set[tuple[str, str]]:
    """The package and name of each class that `value` is an instance of."""
    return {(base.__module__.partition(".")[0], base.__name__) for base in type(value).__mro__}


def is_qiskit_backend(value: object) -> bool:
    """Whether `value` is a Qiskit BackendV2."""
    return ("qiskit", "BackendV2") in _class_paths(value)


def describe(value: object) -> str:
    """What `value` is, in two or three words, such as "a Qiskit circuit"."""
    if is_qiskit_backend(value):
        return "a Qiskit backend"
    if known := _circuit(value):
        return known[0]
    if isinstance(value, str):
        return "a string"
    return "a path" if isinstance(value, Path) else f"an object of type {type(value).__name__}"


def program_hint(value: Any) -> str:
    """A hint: the call that turns `value` into a Program."""
    if known := _circuit(value):
        return known[1]
    if isinstance(value, str | Path):
        return "Use Program.from_qasm(text_or_path) for OpenQASM."
    if hasattr(value, "program"):
        return "Pass its .program."
    return "Use Program.from_qiskit, Program.from_pennylane or Program.from_qasm."


def _circuit(value: object) -> tuple[str, str] | None:
    return next((_CIRCUITS[home] for home in _class_paths(value) if home in _CIRCUITS), None)
