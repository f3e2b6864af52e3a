"""The columns of a drawing: which gates stand below each other, and where a long one is folded."""

from __future__ import annotations

from collections.abc import Sequence

from qcompile.ir import Circuit, Gate

Columns = tuple[tuple[Gate, ...], ...]
"""The gates of each column; no two of them stand on, or cross, the same wire."""


def columns_of(circuit: Circuit) -> Columns:
    """Every gate as far left as its qubits and the wires between them allow."""
    columns: list[list[Gate]] = []
    taken: list[set[int]] = []
    free = [0] * circuit.width
    for gate in circuit.gates:
        wires = set(crossed(gate))
        at = max(free[qubit] for qubit in gate.qubits)
        while at < len(columns) and taken[at] & wires:
            at += 1
        if at == len(columns):
            columns.append([])
            taken.append(set())
        columns[at].append(gate)
        taken[at] |= wires
        for qubit in gate.qubits:
            free[qubit] = at + 1
    return tuple(map(tuple, columns))


def crossed(gate: Gate) -> range:
    """The wires from the first qubit of a gate to its last."""
    return range(min(gate.qubits), max(gate.qubits) + 1)


def side_by_side(circuits: Sequence[Circuit]) -> Columns:
    """The columns of circuits below each other, whose wires are numbered one after the other."""
    columns: list[tuple[Gate, ...]] = []
    first = 0
    for circuit in circuits:
        for index, gates in enumerate(columns_of(circuit)):
            moved = tuple(gate.on(*(first + qubit for qubit in gate.qubits)) for gate in gates)
            if index == len(columns):
                columns.append(())
            columns[index] += moved
        first += circuit.width
    return tuple(columns)


def folds(widths: Sequence[float], room: float) -> list[slice]:
    """The columns of each line, where columns of these widths fill lines of `room`."""
    lines, start, used = [], 0, 0.0
    for index, width in enumerate(widths):
        if index > start and used + width > room:
            lines.append(slice(start, index))
            start, used = index, 0.0
        used += width
    return [*lines, slice(start, len(widths))]
