"""Policies of circuits of several qubits, as the values of their files."""

from __future__ import annotations

from typing import Any


def ring_gates(qubits: int, layers: int = 1) -> list[list[Any]]:
    """Inputs about x, trained turns about y and z, and a ring of cz; trained turns at the end."""
    gates: list[list[Any]] = []
    for layer in range(layers + 1):
        trained = [(qubit, 2 * (layer * qubits + qubit)) for qubit in range(qubits)]
        if layer < layers:
            gates += [["rx", f"x{qubit}", qubit] for qubit in range(qubits)]
        gates += [["ry", f"theta{number}", qubit] for qubit, number in trained]
        gates += [["rz", f"theta{number + 1}", qubit] for qubit, number in trained]
        if layer < layers:
            gates += [["cz", qubit, (qubit + 1) % qubits] for qubit in range(qubits)]
    return gates


def ring_policy(layers: int = 1, **changes: Any) -> dict[str, Any]:
    """A policy of CartPole: a ring of four qubits, read out in pairs."""
    values = {
        "format": "qcompile-policy-2",
        "name": "ring",
        "environment": "CartPole-v1",
        "encoder": {"function": "arctan", "feature": [0, 1, 2, 3], "scale": [1.0, 1.0, 4.0, 1.0]},
        "circuits": [{"qubits": 4, "gates": ring_gates(4, layers)}],
        "observables": [[0, 1], [2, 3]],
        "theta": [0.1 * number for number in range(8 * (layers + 1))],
        "weights": [[3.0, 1.0], [-3.0, -1.0]],
        "bias": [0.0, 0.0],
    }
    return values | changes
