"""Fusing known circuits: against products of Qiskit's matrices, for short and long circuits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from passes.test_promises import Random, difference, unitary

from qcompile.ir import FIXED_GATES, ROTATION_GATES, Circuit, Gate, Program
from qcompile.ir.angle import Angle
from qcompile.passes.fuse_known import FuseKnown

GATES = (*FIXED_GATES, *ROTATION_GATES)


def fused(*circuits: Circuit) -> tuple[Circuit, ...]:
    return FuseKnown().apply(Program(circuits)).circuits


@pytest.mark.parametrize("name", GATES)
def test_each_gate(name):
    circuit = Circuit((Gate(name, Angle(0.6) if name in ROTATION_GATES else None),))
    assert difference(unitary(fused(circuit)[0], {}), unitary(circuit, {}), "unitary") < 1e-15


def test_many_circuits_of_all_lengths():
    random = Random(4)
    circuits = [random.circuit(GATES, ()) for _ in range(300)]
    for before, after in zip(circuits, fused(*circuits), strict=True):
        assert [g.name for g in after.gates] in (
            [], ["rz"], ["ry"], ["rz", "ry"], ["ry", "rz"], ["rz", "ry", "rz"]
        )  # fmt: skip
        assert difference(unitary(before, {}), unitary(after, {}), "unitary") < 1e-13


def test_rounding_errors_do_not_pile_up():
    rng = np.random.default_rng(0)
    names, angles = rng.choice(["rx", "ry", "rz"], 5000), rng.uniform(-4, 4, 5000)
    gates = [Gate(str(n), Angle(float(a))) for n, a in zip(names, angles, strict=True)]
    undone = (*gates, *(Gate(g.name, -g.angle) for g in reversed(gates)))
    assert fused(Circuit(undone))[0] == Circuit()


def test_whole_turns_of_huge_angles_are_exact():
    (circuit,) = fused(Circuit.parse("ry(100000000.0)"))
    polar = next(gate.angle.constant for gate in circuit.gates if gate.name == "ry")
    assert math.cos(polar) == pytest.approx(-0.3633850893556906, abs=1e-14)


def test_circuits_with_symbols_stay_as_they_are():
    program = Program((Circuit.parse("h h ry(x0)"), Circuit.parse("h h")), ("x0",))
    assert FuseKnown().apply(program).circuits == (program.circuits[0], Circuit())
