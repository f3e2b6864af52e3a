"""What objects show of themselves: a line or two, and tables in a notebook."""

from __future__ import annotations

import pydoc
from dataclasses import replace
from typing import Any

import pytest

import qcompile
from qcompile.errors import QcompileError
from qcompile.rl.ppo import Trainer
from qcompile.rl.presets import settings_for
from qcompile.verbs.run_result import RunResult
from qcompile.verbs.validate import Validation

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
    policy = "Policy(trained-cartpole, CartPole-v1, 4 circuits, 14 parameters, 2 actions)"
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


def test_a_long_table_shows_its_beginning_and_its_end() -> None:
    program = qcompile.Program.of([qcompile.Circuit.parse("h")] * 441)
    html = program._repr_html_()
    assert html.count("<tr>") == 1 + 40
    assert [f"<td>{i}</td>" in html for i in (33, 34, 435, 436, 440)] == [1, 0, 0, 1, 1]


def test_a_policy_has_bare_numbers_in_its_table() -> None:
    assert "<td>circuits</td><td>24</td>" in POLICY._repr_html_()


def test_an_interrupted_run_says_so() -> None:
    values = qcompile.run("cartpole", episodes=2, max_steps=1).to_dict()
    result = RunResult(values | {"interrupted": True}, 10)
    words = "Interrupted: 2 of 10 episodes finished. These are the shortest ones:"
    assert repr(result).splitlines()[2].startswith(words)
    assert f"</table><p>{words}" in result._repr_html_()
    assert "nterrupted" not in repr(RunResult(values, 2))


def test_only_means_of_episodes_are_doubted() -> None:
    values = qcompile.run("cartpole", episodes=1, max_steps=1).to_dict() | {"interrupted": True}
    with pytest.raises(QcompileError, match="shortest"):
        RunResult(values, 3).check_complete()
    with pytest.raises(
        QcompileError, match=r"^Interrupted: 0 of 3 .*\n  For a shorter run, use fewer episodes"
    ):
        RunResult(values | {"episodes": []}, 3).check_complete()


def test_what_has_no_picture_has_no_plot() -> None:
    assert not hasattr(Validation({}), "plot")


def test_names_are_no_html() -> None:
    html = replace(POLICY, name="<script>")._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html


def test_help_begins_with_the_verbs() -> None:
    text = pydoc.plain(pydoc.render_doc(qcompile)).split("PACKAGE CONTENTS")[0]
    lines = [line.split()[0] for line in text.splitlines() if line.strip()]
    assert [word for word in lines if word in qcompile.__all__[:7]] == [*qcompile.__all__[:7]]


def test_a_held_policy_says_so_beside_what_it_scored() -> None:
    held = replace(qcompile.load_policy("cartpole"), hold=2)
    settings: dict[str, Any] = {"episodes": 2, "shots": 16, "progress": False}
    result = qcompile.run(held, **settings)
    table = result.table()
    columns, [row] = table.header, table.words
    assert row[columns.index("hold")] == "2"
    assert result.mean_reward_completed is None
    cut = qcompile.run(held, max_steps=3, **settings)
    assert cut.mean_reward_completed == result.mean_reward
    assert "hold" not in qcompile.run("cartpole", max_steps=2, **settings).table().header
