"""Programs with circuits of several qubits: their rows in `qcompile show`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import click
import numpy as np

from qcompile.arrays import FloatArray
from qcompile.passes import Executable
from qcompile.report.circuit_words import gate_words, numbers, product_words
from qcompile.report.drawing.diagram import compiled
from qcompile.report.drawing.text import ROOM, text
from qcompile.report.tables import print_table, wide_console

_MOST_LINES = 100
"""A longer drawing is not printed on the terminal."""
_UNBOUNDED = 1000
"""The width of what is no terminal, at least."""


def wide_values(executable: Executable, index: int) -> dict[str, Any]:
    """The values of a circuit that programs of wide circuits have besides those of narrow ones."""
    source, native = executable.source, executable.native
    before, after = source.circuits[index], native.circuits[index]
    first, start = source.first_bits[index], native.first_bits[index]
    qubits = executable.qubits[start : start + after.width].tolist()
    return {
        "bits": [*range(first, first + before.width)],
        "qubits": qubits[: before.width],
        "routing_qubits": qubits[before.width :],
        "gates_before_by_name": before.gate_counts,
        "couplings_before": before.couplings,
        "couplings": after.couplings,
        "depth_before": before.depth,
        "estimated_success": None
        if executable.device.is_ideal
        else _estimated_success(executable, index),
    }


def observable_values(
    executable: Executable, importance: FloatArray | None
) -> list[dict[str, Any]]:
    """Each observable: its bits, and its share of the importance (observables,)."""
    measured = executable.source.measured
    importance = np.ones(len(measured)) if importance is None else importance
    shares = importance / (importance.sum() or 1.0)
    return [
        {"observable": index, "bits": [*bits], "importance": float(share)}
        for index, (bits, share) in enumerate(zip(measured, shares, strict=True))
    ]


def _estimated_success(executable: Executable, index: int) -> float:
    """The product of 1 - error over the gates, couplings and measurements of a circuit."""
    device, native = executable.device, executable.native
    start, circuit = native.first_bits[index], native.circuits[index]
    qubits = executable.qubits[start : start + circuit.width].tolist()
    errors = [
        (device.qubits[qubit].p10 + device.qubits[qubit].p01) / 2
        for qubit in qubits[: executable.source.widths[index]]
    ]
    for gate in circuit.gates:
        places = [qubits[qubit] for qubit in gate.qubits]
        if gate.is_coupling:
            errors.append(device.coupling_calibrations[gate.name, places[0], places[1]].error)
        elif gate.name in (known := device.qubits[places[0]].gates):
            errors.append(known[gate.name].error)
    return float(math.prod(1 - error for error in errors))


def print_drawing(executable: Executable, numbers: Sequence[int] | None) -> None:
    """Print the circuits before and after compilation, as wide as the terminal."""
    width = wide_console().width
    room = width if width < _UNBOUNDED else ROOM
    drawn = []
    for diagram in compiled(executable, None, numbers):
        drawn.append(text([diagram], room))
        lines = drawn[-1].count("\n")
        if lines > _MOST_LINES:
            drawn[-1] = f"{diagram.title}: a drawing of {lines} lines; --draw writes it to a file\n"
    click.echo("\n".join(drawn), nl=False)


def print_circuits(values: Mapping[str, Any], reads: Sequence[str]) -> None:
    """Print what each circuit has, before and after compilation; `reads` are the inputs' words."""
    after = f"after, for {values['backend']}"
    print_table(
        ["circuit", "bits", *["reads"] * bool(reads), "before", after, "couplings", "depth"],
        [
            [
                row["circuit"],
                numbers(row["bits"]),
                *reads[index : index + 1],
                gate_words(row["gates_before_by_name"]),
                gate_words(row["gates"]),
                f"{row['couplings_before']} to {row['couplings']}",
                f"{row['depth_before']} to {row['depth']}",
            ]
            for index, row in enumerate(values["circuits"])
        ],
        tight=True,
    )


def print_observables(values: Mapping[str, Any]) -> None:
    """Print the observables, and of a policy how much each matters."""
    weighed = "policy" in values
    print_table(
        ["observable", "", *["importance"] * weighed],
        [
            [
                row["observable"],
                product_words(row["bits"]),
                *[f"{100 * row['importance']:5.1f} %"] * weighed,
            ]
            for row in values["observables"]
        ],
    )
