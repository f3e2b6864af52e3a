"""Translate every gate into rotations about z and y."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from qcompile.ir import Circuit, Gate, Program
from qcompile.passes.base import Promise, RunPass


@dataclass(frozen=True)
class ToRotations(RunPass):
    """Afterwards every gate is rz or ry. Symbols are kept. Source: the gate table, `ir.gate`."""

    name: ClassVar[str] = "to_rotations"
    keeps: ClassVar[Promise] = "unitary"

    def rewrite(self, program: Program) -> Program:
        return replace(program, circuits=tuple(map(_rewrite, program.circuits)))


def _rewrite(circuit: Circuit) -> Circuit:
    return Circuit(
        tuple(Gate("r" + axis, angle) for gate in circuit.gates for axis, angle in gate.rotations)
    )
