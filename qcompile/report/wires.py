"""Circuits drawn as wires, and the rows of `qcompile show`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.ir import Circuit, Gate
from qcompile.noise import expected_error, unusable
from qcompile.passes import Executable


def wire(circuit: Circuit) -> str:
    """A circuit as one line: |0>─ h ─ ry(x0) ─ M."""
    return "|0>─" + "─".join([*(f" {_short(gate)} " for gate in circuit.gates), " M"])


def _short(gate: Gate) -> str:
    if gate.angle is not None and gate.angle.is_constant:
        text = str(gate)
        return text if "pi" in text or len(text) < 12 else f"{gate.name}({gate.angle.constant:.4f})"
    return str(gate)


def executable_values(
    executable: Executable,
    importance: FloatArray | None = None,
    numbers: Sequence[int] | None = None,
) -> dict[str, Any]:
    """The plain values of `qcompile show --json`.

    `importance` (circuits,) is what the placement followed; left out, it is the same for all.
    `numbers` are what the circuits are called, instead of 0, 1, ...
    """
    native, device = executable.native, executable.device
    importance = np.ones(len(native)) if importance is None else importance
    shares = importance / (importance.sum() or 1.0)
    circuits = []
    rows = zip(executable.source.circuits, native.circuits, executable.gate_counts(), strict=True)
    for index, (source, compiled, counts) in enumerate(rows):
        qubit = int(executable.qubits[index])
        circuits.append(
            {
                "circuit": index if numbers is None else numbers[index],
                "source": str(source),
                "compiled": str(compiled),
                "gates_before": len(source),
                "gates": dict(sorted(counts.items())),
                "depth": len(compiled),
                "qubit": qubit,
                "round": int(executable.rounds[index]),
                "importance": float(shares[index]),
                "expected_error": None if device.is_ideal else expected_error(device, qubit),
            }
        )
    return {
        "backend": device.name,
        "level": executable.level,
        "inputs": len(executable.source.inputs),
        "parameters": len(executable.source.parameters),
        "rounds": executable.round_count,
        "copies_that_fit": executable.copies_that_fit,
        "left_out": [
            {"qubit": qubit, "reason": reason} for qubit, reason in unusable(device).items()
        ],
        "circuits": circuits,
        "definitions": [str(late) for late in native.late_angles],
    }
