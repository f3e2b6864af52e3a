"""Circuits drawn as wires, and the rows of `qcompile show`."""

from __future__ import annotations

from typing import Any

from qcompile.ir import Circuit, Gate
from qcompile.passes import Executable


def wire(circuit: Circuit) -> str:
    """A circuit as one line: |0>─ h ─ ry(x0) ─ M."""
    return "|0>─" + "─".join([*(f" {_short(gate)} " for gate in circuit.gates), " M"])


def _short(gate: Gate) -> str:
    if gate.angle is not None and gate.angle.is_constant:
        text = str(gate)
        return text if "pi" in text or len(text) < 12 else f"{gate.name}({gate.angle.constant:.4f})"
    return str(gate)


def executable_values(executable: Executable) -> dict[str, Any]:
    """The plain values of `qcompile show --json`."""
    native = executable.native
    circuits = []
    rows = zip(executable.source.circuits, native.circuits, executable.gate_counts(), strict=True)
    for index, (source, compiled, counts) in enumerate(rows):
        circuits.append(
            {
                "circuit": index,
                "source": str(source),
                "compiled": str(compiled),
                "gates_before": len(source),
                "gates": dict(sorted(counts.items())),
                "depth": len(compiled),
                "qubit": int(executable.qubits[index]),
                "round": int(executable.rounds[index]),
            }
        )
    return {
        "backend": executable.device.name,
        "level": executable.level,
        "inputs": len(executable.source.inputs),
        "parameters": len(executable.source.parameters),
        "rounds": executable.round_count,
        "circuits": circuits,
        "definitions": [str(definition) for definition in native.definitions],
    }
