"""Cells that were stored before devices had couplings are still found."""

from __future__ import annotations

from dataclasses import replace

import qcompile
from qcompile.execution import load_backend
from qcompile.ir import Circuit, Program
from qcompile.policy import Policy, load_policy
from qcompile.sweep.evaluation.grid import Cell

STORED = "be972aaeced288d6153717e588cf8e63411e3e710955b1a3382808697189922c"
"""The device in a cell on fake_lima, printed by the version without couplings."""


def settings(policy: Policy) -> dict[str, object]:
    return Cell(policy, load_backend("fake_lima"), 64, "none", 2, 20, 0).settings()


def test_a_cell_of_circuits_of_one_qubit_is_the_stored_one() -> None:
    policy = load_policy("cartpole_1q")
    assert isinstance(policy, Policy)
    assert settings(policy)["device"] == STORED
    assert "couplings" not in settings(policy)


def test_a_cell_of_wider_circuits_depends_on_couplings() -> None:
    policy = load_policy("cartpole_1q")
    assert isinstance(policy, Policy)
    inputs = len(policy.program.inputs)
    program = Program.of([Circuit.parse("ry(x0)@0 cz@0,1", 2)], inputs)
    wide = replace(
        policy, program=program, theta=policy.theta[:0], weights=policy.weights[:, [0, 0]], reuse=1
    )
    device = qcompile.load_device("fake_lima")
    assert settings(wide)["device"] == STORED
    assert settings(wide)["couplings"] != settings(wide)["device"]
    assert device.without_couplings().couplings == ()
