"""Objects of other packages, told by where their classes are at home: nothing is imported."""

from __future__ import annotations

from pathlib import Path
from typing import Any

_CIRCUITS = {
    ("qiskit", "QuantumCircuit"): ("a Qiskit circuit", "Program.from_qiskit(circuit)"),
    ("pennylane", "QNode"): (
        "a PennyLane QNode",
        "Program.from_pennylane(qnode, inputs=2, parameters=3)",
    ),
    ("pennylane", "QuantumScript"): ("a PennyLane tape", "Program.from_pennylane(tape)"),
    ("cirq", "Circuit"): ("a Cirq circuit", "Program.from_qasm(circuit.to_qasm())"),
}


def _class_paths(value: object) -> set[tuple[str, str]]:
    """Package and name of each class of `value`."""
    return {(base.__module__.partition(".")[0], base.__name__) for base in type(value).__mro__}


def is_qiskit_backend(value: object) -> bool:
    """Whether `value` is a Qiskit BackendV2."""
    return ("qiskit", "BackendV2") in _class_paths(value)


def describe(value: object) -> str:
    """`value` in two or three words, such as "a Qiskit circuit"."""
    if is_qiskit_backend(value):
        return "a Qiskit backend"
    if known := _circuit(value):
        return known[0]
    if isinstance(value, str):
        return "a text"
    return "a path" if isinstance(value, Path) else f"an object of type {type(value).__name__}"


def program_hint(value: Any) -> str:
    """The call that makes a Program of `value`, as a line of advice."""
    if known := _circuit(value):
        return known[1]
    if isinstance(value, str | Path):
        return "Program.from_qasm(text_or_path) reads OpenQASM"
    if hasattr(value, "program"):
        return "give its .program"
    return "Program.from_qiskit, Program.from_pennylane and Program.from_qasm make one"


def _circuit(value: object) -> tuple[str, str] | None:
    return next((_CIRCUITS[home] for home in _class_paths(value) if home in _CIRCUITS), None)
