"""Drop rotations that do not affect the Z measurement from |0>."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from qcompile.ir import Circuit, Gate, Program
from qcompile.passes.base import Promise


@dataclass(frozen=True)
class DropUnobservable:
    """Afterwards no circuit begins or ends with a rotation about z, and no late angle is unused.

    |0> is an eigenstate of Rz, and Rz before a Z measurement only changes a phase.
    """

    name: ClassVar[str] = "drop_unobservable"
    keeps: ClassVar[Promise] = "distribution"

    def apply(self, program: Program) -> Program:
        circuits = tuple(map(_trim, program.circuits))
        used = {symbol for circuit in circuits for symbol in circuit.symbols}
        late_angles = tuple(late for late in program.late_angles if late.name in used)
        return replace(program, circuits=circuits, late_angles=late_angles)


def _trim(circuit: Circuit) -> Circuit:
    gates = list(circuit.gates)
    while gates and _about_z(gates[-1]):
        gates.pop()
    while gates and _about_z(gates[0]):
        gates.pop(0)
    return Circuit(tuple(gates))


def _about_z(gate: Gate) -> bool:
    return all(axis == "z" for axis, _ in gate.rotations)
