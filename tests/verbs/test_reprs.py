"""What objects show of themselves: a line or two, and tables in a notebook."""

from __future__ import annotations

import pydoc
from dataclasses import replace
from typing import Any

import pytest

import qcompile
from qcompile.rl.ppo import Trainer
from qcompile.rl.presets import settings_for

POLICY = qcompile.load_policy("lunarlander")
LAGOS = qcompile.load_device("fake_lagos")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (POLICY, "Policy(lunarlander, LunarLander-v3, 24 circuits, 148 parameters, 4 actions)"),
        (POLICY.encoder, "Encoder(arctan, 24 inputs of 8 features)"),
        (POLICY.program, "Program(24 circuits, 24 inputs, 24 parameters)"),
        (POLICY.program.circuits[0], "Circuit(h ry(x0) rz(x0) ry(theta0))"),
        (LAGOS, "Device(fake_lagos, 7 qubits, rz sx x)"),
        (qcompile.load_device("ideal"), "Device(ideal, perfect qubits, rz sx x)"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_repr_is_a_line(value: Any, text: str) -> None:
    assert repr(value) == text


def test_a_long_circuit_is_cut() -> None:
    circuit = qcompile.Circuit.parse("ry(0.125) " * 500)
    assert len(repr(circuit)) < 120
    assert repr(circuit).endswith("ry(0.125) ...)")


def test_trainings() -> None:
    trainer = Trainer("CartPole-v1", settings_for("paper", "CartPole-v1").changed(episodes=2), 4)
    assert repr(trainer) == "Trainer(CartPole-v1, svqc, seed 4, 0 episodes, 0% of the training)"
    result = trainer.train()
    policy = "Policy(cartpole, CartPole-v1, 4 circuits, 14 parameters, 2 actions)"
    assert repr(result).startswith(f"TrainingResult({policy}, 2 episodes, ")


def test_executables_say_where_they_run() -> None:
    assert repr(qcompile.compile(POLICY.program, LAGOS)).startswith(
        "Executable(24 circuits on fake_"
    )


@pytest.mark.parametrize(
    ("value", "rows"),
    [(POLICY, 5), (POLICY.encoder, 25), (POLICY.program, 25), (LAGOS, 8)],
    ids=lambda value: type(value).__name__,
)
def test_tables_have_a_row_for_each(value: Any, rows: int) -> None:
    assert value._repr_html_().count("<tr>") == rows


def test_names_are_no_html() -> None:
    html = replace(POLICY, name="<script>")._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html


def test_help_begins_with_the_verbs() -> None:
    text = pydoc.plain(pydoc.render_doc(qcompile)).split("PACKAGE CONTENTS")[0]
    lines = [line.split()[0] for line in text.splitlines() if line.strip()]
    assert [word for word in lines if word in qcompile.__all__[:7]] == [*qcompile.__all__[:7]]
