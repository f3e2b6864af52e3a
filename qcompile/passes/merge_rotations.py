"""Add neighbouring rotations about the same axis, including symbolic ones."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from qcompile.ir import Circuit, Gate, Program
from qcompile.passes.base import Promise, RunPass

_ROTATIONS = {"rx", "ry", "rz"}


@dataclass(frozen=True)
class MergeRotations(RunPass):
    """Afterwards no neighbours rotate about the same axis, and no rotation is the identity.

    Two rotations merge even with a half turn about another axis between them: R(b) H R(a) =
    R(b-a) H, because H R(a) = R(-a) H. Angles stay in (-pi, pi]. Other gates are unchanged.
    """

    name: ClassVar[str] = "merge_rotations"
    keeps: ClassVar[Promise] = "unitary"

    def rewrite(self, program: Program) -> Program:
        return replace(program, circuits=tuple(map(_merge, program.circuits)))


def _merge(circuit: Circuit) -> Circuit:
    merged: list[Gate] = []
    for gate in circuit.gates:
        _push(merged, gate)
    return Circuit(tuple(merged))


def _push(merged: list[Gate], gate: Gate) -> None:
    """Append `gate`, merged with the last gate if possible."""
    if gate.angle is not None:
        gate = Gate(gate.name, gate.angle.wrapped())
        if gate.angle.equals(0.0):  # type: ignore[union-attr]
            return
    if merged and (joined := _joined(merged[-1], gate)) is not None:
        merged.pop()
        for part in joined:
            _push(merged, part)
        return
    if len(merged) > 1 and _mirrors(merged[-1], gate) and _same_axis(merged[-2], gate):
        mirror, before = merged.pop(), merged.pop()
        _push(merged, mirror)
        _push(merged, Gate(gate.name, gate.angle - before.angle))  # type: ignore[operator]
        return
    merged.append(gate)


def _joined(first: Gate, second: Gate) -> tuple[Gate, ...] | None:
    """The gates that replace two neighbours, or None if they do not merge."""
    if first.name == second.name == "x":
        return ()
    if _same_axis(first, second):
        return (Gate(first.name, first.angle + second.angle),)  # type: ignore[operator]
    return None


def _same_axis(first: Gate, second: Gate) -> bool:
    return first.name == second.name and first.name in _ROTATIONS


def _mirrors(gate: Gate, other: Gate) -> bool:
    """Whether `gate` is a half turn that reverses the axis of the rotation `other`."""
    if other.name not in _ROTATIONS:
        return False
    if gate.name == "x":
        return other.name != "rx"
    return gate.name in _ROTATIONS - {other.name} and gate.angle.equals(math.pi)  # type: ignore[union-attr]
