"""The shape of a circuit of several qubits: runs and couplings in order, whatever the angles."""

from __future__ import annotations

from typing import NamedTuple

from qcompile.ir import Circuit, Gate

CHUNK = 1 << 18
"""The numbers of a state computed at a time: many enough that calls cost little beside them."""


class RunPlace(NamedTuple):
    """A run: its qubit, its slots in the circuit, and its number among the runs."""

    qubit: int
    slots: tuple[int, ...]
    number: int


class CouplingPlace(NamedTuple):
    gate: Gate
    number: int


class Shape:
    """The order of runs and couplings in circuits whose gates differ only in their angles.

    Every qubit begins and ends with a run, which may be empty.
    """

    def __init__(self, circuit: Circuit):
        self.width = circuit.width
        self.runs: list[RunPlace] = []
        self.gates: list[tuple[Gate, ...]] = []
        self.couplings: list[CouplingPlace] = []
        self.parts: list[RunPlace | CouplingPlace] = []
        waiting: list[list[tuple[Gate, int]]] = [[] for _ in range(circuit.width)]
        slot = 0
        for gate in circuit.gates:
            if gate.is_coupling:
                for qubit in gate.qubits:
                    self._end(qubit, waiting[qubit])
                self.couplings.append(CouplingPlace(gate, len(self.couplings)))
                self.parts.append(self.couplings[-1])
            else:
                waiting[gate.qubits[0]].append((gate.on(0), slot))
                slot += gate.angle is not None
        begun = {run.qubit for run in self.runs}
        for qubit in sorted(set(range(circuit.width)) - begun):
            self._end(qubit, waiting[qubit])
        for qubit in range(circuit.width):
            self._end(qubit, waiting[qubit])
        self.first = [next(r for r in self.runs if r.qubit == q) for q in range(self.width)]
        self.last = self.runs[-self.width :]
        edges = {*self.first, *self.last}
        self.middle = [part for part in self.parts if part not in edges]

    def _end(self, qubit: int, waiting: list[tuple[Gate, int]]) -> None:
        slots = tuple(slot for gate, slot in waiting if gate.angle is not None)
        run = RunPlace(qubit, slots, len(self.runs))
        self.runs.append(run)
        self.parts.append(run)
        self.gates.append(tuple(gate for gate, _ in waiting))
        waiting.clear()
