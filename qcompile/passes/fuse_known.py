"""Fuse circuits whose angles are all known into at most three rotations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import ClassVar

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Angle, Circuit, Gate, Program
from qcompile.ir.turns import reduced
from qcompile.passes.base import Promise, RunPass
from qcompile.simulate import euler_angles


@dataclass(frozen=True)
class FuseKnown(RunPass):
    """Afterwards every circuit without symbols is at most rz(first) ry(polar) rz(last).

    Gates are unit quaternions, w - i (x X + y Y + z Z). The quaternions of all circuits are
    multiplied pairwise: a million gates take twenty steps, and rounding errors do not accumulate.
    """

    name: ClassVar[str] = "fuse_known"
    keeps: ClassVar[Promise] = "unitary"

    def rewrite(self, program: Program) -> Program:
        fused = list(program.circuits)
        known = [i for i, circuit in enumerate(fused) if circuit.gates and not circuit.symbols]
        if known:
            w, x, y, z = _products([fused[i].gates for i in known]).T
            angles = np.stack(euler_angles(w - 1j * z, y - 1j * x), axis=1)
            for index, row in zip(known, angles.tolist(), strict=True):
                fused[index] = euler_circuit(*map(Angle, row))
        return replace(program, circuits=tuple(fused))


def euler_circuit(first: Angle, polar: Angle, last: Angle) -> Circuit:
    """rz(first) ry(polar) rz(last), without rotations by 0."""
    gates = (Gate("rz", first), Gate("ry", polar), Gate("rz", last))
    return Circuit(tuple(g for g in gates if not g.angle.equals(0.0)))  # type: ignore[union-attr]


def _products(circuits: Sequence[Sequence[Gate]]) -> FloatArray:
    """The unitary of each circuit as a quaternion, (circuits, 4)."""
    counts = np.array([len(gates) for gates in circuits])
    total = int(counts.sum())
    code = np.fromiter((_CODE[g.name] for g in chain(*circuits)), np.intp, total)
    angle = np.fromiter(
        (g.angle.constant if g.angle else 0.0 for g in chain(*circuits)), float, total
    )
    half = reduced(angle)[:, None] / 2
    product = np.cos(half) * _COSINE[code] + np.sin(half) * _SINE[code]
    while counts.max() > 1:
        start = np.repeat(np.cumsum(counts) - counts, counts)
        position = np.arange(len(product)) - start
        left = position % 2 == 0
        paired = left & (position + 1 < np.repeat(counts, counts))
        first = np.flatnonzero(paired)
        multiplied = _multiply(product[first + 1], product[first])
        product = product[left]
        product[paired[left]] = multiplied
        counts = (counts + 1) // 2
    return product


def _multiply(after: FloatArray, before: FloatArray) -> FloatArray:
    (a, b, c, d), (w, x, y, z) = after.T, before.T
    return np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=1,
    )


def _table() -> tuple[dict[str, int], FloatArray, FloatArray]:
    """A row for each gate: its quaternion is cos(angle / 2) cosine + sin(angle / 2) sine."""
    axes = {"rx": 1, "ry": 2, "rz": 3, "p": 3}
    code = {name: row for row, name in enumerate((*FIXED_GATES, *ROTATION_GATES))}
    cosine, sine = np.zeros((2, len(code), 4))
    cosine[:, 0] = 1.0
    for name, axis in axes.items():
        sine[code[name], axis] = 1.0
    for name, rotations in FIXED_GATES.items():
        for about, angle in rotations:
            turn, half = np.zeros((1, 4)), angle.constant / 2
            turn[0, 0], turn[0, {"y": 2, "z": 3}[about]] = np.cos(half), np.sin(half)
            cosine[code[name]] = _multiply(turn, cosine[code[name]][None])[0]
    return code, cosine, sine


_CODE, _COSINE, _SINE = _table()
