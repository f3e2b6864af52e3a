"""Passes and levels keep their promises on circuits of several qubits, by Qiskit's operators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from wide import ANY, SPECIAL, SYMBOLS, operator, random_circuit

from qcompile.ir import COUPLINGS, Circuit, Program
from qcompile.ir.runs import split
from qcompile.native import RX, SX
from qcompile.passes import LEVELS, PASSES, Pass, pipeline
from qcompile.passes.commute_rz import CommuteRz
from qcompile.passes.drop_unobservable import DropIdleCouplings, DropUnobservable
from qcompile.passes.fuse_rotations import FuseRotations
from qcompile.passes.to_couplings import ToCouplings
from qcompile.simulate import LateAngles

STEPS: dict[str, tuple[list[Pass], tuple[str, ...]]] = {
    cls.name: ([cls()], ("rz", "ry") if cls is FuseRotations else ANY) for cls in PASSES
}
STEPS |= {f"to {name}": ([ToCouplings((name,))], ANY) for name in COUPLINGS}
STEPS |= {
    f"level {level}, {native}, {coupling}": (pipeline(level, native, (coupling,)), ANY)
    for level in LEVELS
    for native in (SX, RX)
    for coupling in COUPLINGS
}


def difference(first: np.ndarray, second: np.ndarray, promise: str) -> float:
    if promise == "distribution":
        return float(np.abs(abs(first[:, 0]) ** 2 - abs(second[:, 0]) ** 2).max())
    overlap = np.trace(first.conj().T @ second)
    return float(np.abs(first * (overlap / abs(overlap)) - second).max())


def random_program(
    rng: np.random.Generator, gates: Sequence[str], widths: Sequence[int]
) -> Program:
    return Program.of([random_circuit(rng, gates, width) for width in widths], 2, 2)


def broken(passes: Sequence[Pass], program: Program, point: np.ndarray) -> list[str]:
    """Where the promise fails for the values `point` of the symbols: a line for each circuit."""
    after = program
    for step in passes:
        after = step.apply(after)
    promise = "distribution" if "distribution" in {p.keeps for p in passes} else "unitary"
    values = dict(zip(SYMBOLS, point.tolist(), strict=True))
    if after.late_angles:
        late_angles = LateAngles(after.late_angles, program.inputs, program.parameters)
        found = late_angles(point[None, :2], point[2:])[0]
        values |= {late.name: v for late, v in zip(after.late_angles, found, strict=True)}
    assert after.widths == program.widths
    assert after.observables == program.observables
    return [
        f"{before} -> {now} at {values}: {promise} differs by {gap:.2e}"
        for before, now in zip(program.circuits, after.circuits, strict=True)
        if not (gap := difference(operator(before, values), operator(now, values), promise)) < 1e-11
    ]


@pytest.mark.parametrize("step", STEPS)
def test_the_promise_on_random_wide_circuits(step: str) -> None:
    passes, gates = STEPS[step]
    rng = np.random.default_rng(sorted(STEPS).index(step))
    for _ in range(6):
        widths = rng.integers(1, 6, 12).tolist()
        program = random_program(rng, gates, widths)
        program = replace(program, observables=((0,), (program.bits - 1,)))
        assert broken(passes, program, rng.uniform(-4, 4, 4)) == []
        special = np.array([float(number) for number in rng.choice(SPECIAL, 4)])
        assert broken(passes, program, special) == []


def test_the_check_sees_a_broken_promise() -> None:
    class Wrong:
        name, keeps = "wrong", "unitary"

        def apply(self, program: Program) -> Program:
            return Program.of([Circuit.parse("cz@0,1 s@1", 2)], 2, 2)

    one = Program.of([Circuit.parse("cz@0,1", 2)], 2, 2)
    assert broken([Wrong()], one, np.zeros(4))
    Wrong.keeps = "distribution"
    assert not broken([Wrong()], one, np.zeros(4))


def test_runs_come_back_to_their_places() -> None:
    rng = np.random.default_rng(3)
    program = random_program(rng, ANY, [3, 1, 4, 2])
    runs, skeleton = split(program)
    assert set(runs.widths) == {1}
    joined = skeleton.join(runs)
    assert broken([], joined, np.ones(4)) == []
    for before, after in zip(program.circuits, joined.circuits, strict=True):
        assert np.allclose(operator(before, ones()), operator(after, ones()))
        assert sorted(map(str, before.gates)) == sorted(map(str, after.gates))


def ones() -> dict[str, float]:
    return dict.fromkeys(SYMBOLS, 1.0)


def test_z_rotations_pass_couplings_and_disappear_before_the_measurement() -> None:
    text = "ry(x0)@0 rz(x1)@0 cz@0,1 rz(theta0)@1 cx@1,2 ry(1.0)@2 rz(theta1)@2"
    program = Program.of([Circuit.parse(text, 3)], 2, 2)
    moved = CommuteRz().apply(program).circuits[0]
    assert str(moved) == ("ry(x0)@0 cz@0,1 cx@1,2 ry(1.0)@2 rz(x1)@0 rz(theta0)@1 rz(theta1)@2")
    assert str(DropUnobservable().apply(program).circuits[0]) == "ry(x0)@0 cz@0,1 cx@1,2 ry(1.0)@2"
    ecr = Program.of([Circuit.parse("rz(x0)@0 rz(x1)@1 ecr@0,1", 2)], 2)
    assert str(CommuteRz().apply(ecr).circuits[0]) == "rz(x1)@1 ecr@0,1 rz(-x0)@0"


def test_couplings_that_do_nothing_are_dropped() -> None:
    text = "cz@0,1 h@0 cx@1,2 cx@0,1 cz@0,2 s@0 cz@1,2"
    program = Program.of([Circuit.parse(text, 3)])
    kept = DropIdleCouplings().apply(program).circuits[0]
    assert str(kept) == "h@0 cx@0,1 s@0"


def test_a_layer_about_two_axes_is_one_fused_run() -> None:
    """16 runs of three rotations each: two sx a run."""
    rings = " ".join(f"cz@{i},{(i + 1) % 4}" for i in range(4))
    layer = " ".join(f"rx(x0)@{i} ry(theta0)@{i} rz(theta1)@{i}" for i in range(4))
    text = f"{layer} {rings} {layer} {rings} {layer} {rings} {layer}"
    program = Program.of([Circuit.parse(text, 4)], 1, 2)
    for step in pipeline(2, SX):
        program = step.apply(program)
    names = [gate.name for gate in program.circuits[0].gates]
    assert (names.count("sx"), names.count("cz")) == (32, 12)
