"""Fuse a run of rotations into three, whether their angles are known yet or not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from qcompile.ir import Angle, Circuit, Definition, Gate, Program
from qcompile.passes.base import Promise
from qcompile.simulate import Simulator

_EULER_RUNS = {("rz", "ry", "rz"), ("rz", "ry"), ("ry", "rz"), ("rz",), ("ry",), ()}


@dataclass(frozen=True)
class FuseRotations:
    """After it every circuit is at most rz(first) ry(polar) rz(last), the Euler angles of its run.

    Requires circuits of rz and ry (`to_rotations`). Known angles are fused to numbers. A run that
    holds symbols and is longer than three becomes three new symbols, defined by the run itself:
    the structure is fused now, the numbers when the program is bound, for a whole batch at once.
    """

    name: ClassVar[str] = "fuse_rotations"
    keeps: ClassVar[Promise] = "unitary"

    def apply(self, program: Program) -> Program:
        fused = list(program.circuits)
        known = [i for i, circuit in enumerate(fused) if not circuit.symbols]
        if known:
            numbers = _euler_numbers([fused[i] for i in known])
            for index, angles in zip(known, numbers, strict=True):
                fused[index] = _euler_circuit(*map(Angle, angles))
        definitions = list(program.definitions)
        prefix = _free_prefix(program)
        for index, circuit in enumerate(fused):
            if circuit.symbols and tuple(g.name for g in circuit.gates) not in _EULER_RUNS:
                made = [
                    Definition(f"{prefix}{part}{index}", circuit, part)
                    for part in ("first", "polar", "last")
                ]
                definitions += made
                fused[index] = _euler_circuit(*(Angle.symbol(d.name) for d in made))
        return replace(program, circuits=tuple(fused), definitions=tuple(definitions))


def _euler_numbers(circuits: list[Circuit]) -> list[tuple[float, float, float]]:
    nothing = np.zeros((1, 0)), np.zeros(0)
    first, polar, last = Simulator(Program(tuple(circuits))).euler(*nothing)
    return [tuple(map(float, row)) for row in np.stack([first[0], polar[0], last[0]]).T]  # type: ignore[misc]


def _euler_circuit(first: Angle, polar: Angle, last: Angle) -> Circuit:
    gates = (Gate("rz", first), Gate("ry", polar), Gate("rz", last))
    return Circuit(tuple(g for g in gates if not g.angle.equals(0.0)))  # type: ignore[union-attr]


def _free_prefix(program: Program) -> str:
    """A prefix that keeps the new names apart from the program's own symbols."""
    prefix = ""
    while any(
        s.startswith(tuple(prefix + p for p in ("first", "polar", "last"))) for s in program.symbols
    ):
        prefix += "_"
    return prefix
