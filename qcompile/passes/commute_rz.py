"""Move rotations about z through couplings, towards the end of the circuit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from qcompile.ir import Angle, Circuit, Gate, Program
from qcompile.passes.base import Promise


@dataclass(frozen=True)
class CommuteRz:
    """Afterwards no rz stands directly before a cz, or before a cx or ecr on their control.

    Rz commutes with cz and with the control of cx; the control of ecr turns its sign. Runs that
    were nothing but rotations about z are gone.
    """

    name: ClassVar[str] = "commute_rz"
    keeps: ClassVar[Promise] = "unitary"

    def apply(self, program: Program) -> Program:
        if not program.is_wide:
            return program
        return replace(program, circuits=tuple(map(_commuted, program.circuits)))


def _commuted(circuit: Circuit) -> Circuit:
    if circuit.width == 1:
        return circuit
    waiting = [Angle()] * circuit.width
    gates: list[Gate] = []

    def flush(qubit: int) -> None:
        if not waiting[qubit].equals(0.0):
            gates.append(Gate("rz", waiting[qubit].wrapped(), (qubit,)))
        waiting[qubit] = Angle()

    for gate in circuit.gates:
        first, last = gate.qubits[0], gate.qubits[-1]
        if gate.name == "rz":
            assert gate.angle is not None
            waiting[first] = waiting[first].moderate() + gate.angle.moderate()
            continue
        if gate.name == "ecr":
            waiting[first] = -waiting[first]
        if gate.name != "cz":
            flush(last)
        gates.append(gate)
    for qubit in range(circuit.width):
        flush(qubit)
    return Circuit(tuple(gates), circuit.width)
