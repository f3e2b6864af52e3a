"""Fuse a sequence of rotations whose angles are not known yet into three."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from qcompile.ir import Angle, LateAngle, Program
from qcompile.passes.base import Promise, RunPass
from qcompile.passes.fuse_known import euler_circuit

_EULER_RUNS = {("rz", "ry", "rz"), ("rz", "ry"), ("ry", "rz"), ("rz",), ("ry",), ()}


@dataclass(frozen=True)
class FuseRotations(RunPass):
    """Afterwards a circuit with symbols is at most rz(first) ry(polar) rz(last): its Euler angles.

    Requires circuits of rz and ry (`to_rotations`). More than three rotations become three late
    angles, defined by those rotations: the structure is fused now, the numbers when the program is
    bound, for a whole batch at once. Circuits without symbols are left to `fuse_known`.
    """

    name: ClassVar[str] = "fuse_rotations"
    keeps: ClassVar[Promise] = "unitary"

    def rewrite(self, program: Program) -> Program:
        fused = list(program.circuits)
        late_angles = list(program.late_angles)
        prefix = _free_prefix(program)
        for index, circuit in enumerate(fused):
            if circuit.symbols and tuple(g.name for g in circuit.gates) not in _EULER_RUNS:
                angles = [
                    LateAngle(f"{prefix}{part}{index}", circuit, part)
                    for part in ("first", "polar", "last")
                ]
                late_angles += angles
                fused[index] = euler_circuit(*(Angle.symbol(late.name) for late in angles))
        return replace(program, circuits=tuple(fused), late_angles=tuple(late_angles))


def _free_prefix(program: Program) -> str:
    """A prefix for new names that no symbol of the program starts with."""
    prefix = ""
    while any(
        s.startswith(tuple(prefix + p for p in ("first", "polar", "last"))) for s in program.symbols
    ):
        prefix += "_"
    return prefix
