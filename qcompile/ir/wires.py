"""Wires: gates on numbered qubits as they come, and the circuits that they make."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from itertools import chain

from qcompile.ir.circuit import Circuit
from qcompile.ir.connected import connected
from qcompile.ir.gate import Gate

Step = tuple[Gate, tuple[int, ...]]
"""A gate and the qubits it acts on. A gate on one qubit is that on qubit 0, wherever it acts."""


def steps(gates: Iterable[Gate]) -> tuple[Step, ...]:
    """The steps of gates, each on its own qubits."""
    return tuple(
        (gate if len(gate.qubits) > 1 or gate.qubits == (0,) else gate.on(0), gate.qubits)
        for gate in gates
    )


class Wires:
    """Gates on numbered qubits, in order; qubits that couplings connect become one circuit.

    `gates` has the gates of each qubit, those on one qubit as gates on qubit 0. A coupling is in
    the lists of both its qubits, so the length of a list is the number of gates on the qubit.
    """

    def __init__(self) -> None:
        self.gates: defaultdict[int, list[Gate]] = defaultdict(list)
        self._couplings: list[Gate] = []
        self._equal: dict[tuple[str, int, int], Gate] = {}

    def apply(self, steps: Iterable[Step], qubits: Sequence[int]) -> None:
        """Append steps, whose qubit k is `qubits[k]`."""
        for gate, places in steps:
            if len(places) == 1:
                self.gates[qubits[places[0]]].append(gate)
            else:
                self._couple(gate.name, qubits[places[0]], qubits[places[1]])

    def _couple(self, name: str, control: int, target: int) -> None:
        key = (name, control, target)
        gate = self._equal.get(key)
        if gate is None:
            gate = self._equal[key] = Gate(name, None, (control, target))
        self._couplings.append(gate)
        self.gates[control].append(gate)
        self.gates[target].append(gate)

    def circuits(self, qubits: int) -> tuple[tuple[Circuit, ...], tuple[int, ...]]:
        """The circuits of qubits 0 to `qubits` - 1, and the qubit of each of their bits.

        Circuits come in the order of their lowest qubits, and the qubits of a circuit in their own.
        A qubit without gates is a circuit. Couplings keep their order, and gates on one qubit stand
        right before the next coupling of theirs, as passes leave them. The wires are empty then.
        """
        groups = connected(range(qubits), {gate.qubits for gate in self._equal.values()})
        owner = {qubit: index for index, group in enumerate(groups) for qubit in group}
        couplings: list[list[Gate]] = [[] for _ in groups]
        for gate in self._couplings:
            couplings[owner[gate.qubits[0]]].append(gate)
        circuits = tuple(map(self._circuit, groups, couplings))
        return circuits, tuple(chain.from_iterable(groups))

    def _circuit(self, qubits: Sequence[int], couplings: Iterable[Gate]) -> Circuit:
        if len(qubits) == 1:
            return Circuit(tuple(self.gates.pop(qubits[0], ())))
        place = {qubit: index for index, qubit in enumerate(qubits)}
        rest = {qubit: iter(self.gates.pop(qubit)) for qubit in qubits}
        moved: dict[tuple[int, int], Gate] = {}
        gates: list[Gate] = []

        def move(gate: Gate, *places: int) -> Gate:
            """The gate in its place; equal ones are one object."""
            key = id(gate), places[0]
            if key not in moved:
                moved[key] = gate if gate.qubits == places else gate.on(*places)
            return moved[key]

        def take_run(qubit: int) -> None:
            """Take the gates of a qubit up to its next coupling, and drop this one."""
            for gate in rest[qubit]:
                if len(gate.qubits) > 1:
                    break
                gates.append(move(gate, place[qubit]))

        for coupling in couplings:
            control, target = coupling.qubits
            take_run(control)
            take_run(target)
            gates.append(move(coupling, place[control], place[target]))
        for qubit in qubits:
            take_run(qubit)
        return Circuit(tuple(gates), len(qubits))
