"""What is saved at the end of a command: each file on its own, and the results in any case."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qcompile.errors import FigureError
from qcompile.sweep.complete import CellFailure

Call = Callable[..., Any]

ALL = ("--plot", "a.svg", "--table", "a.md", "--report", "a.html")
SMALL = ("--style", "small.mplstyle")


@pytest.fixture
def undrawable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures that cannot be drawn, which no trial finds."""

    def draw(*_: object) -> None:
        raise FigureError("The style leaves no room.", "Give it more.")

    for name in ("verbs.run_result.draw_rewards", "sweep.evaluation.write_up.draw_intervals"):
        monkeypatch.setattr(f"qcompile.{name}", draw)
    monkeypatch.setattr("qcompile.verbs.calibrations.Calibration.plot", draw)


@pytest.mark.parametrize(
    "words",
    [
        ("run", "tiny.json", "--episodes", 1, "--max-steps", 2),
        ("evaluate", "tiny.json", "--episodes", 1, "--shots", 16, "--workers", 1),
        ("calibrate", "--backend", "fake_lima", "--shots", 100),
        ("train", "CartPole-v1", "--episodes", 1, "--out", "p.json"),
        ("plan", "tiny.json", "--backend", "fake_lima"),
        ("study", "paper"),
    ],
    ids=lambda words: words[0],
)
def test_a_style_without_room_is_refused_before_anything_is_run(
    qcompile: Call, policy: Call, left: Call, words: tuple[object, ...]
) -> None:
    policy()
    Path("small.mplstyle").write_text("figure.figsize: 0.5, 0.5\n")
    answer = qcompile(*words, "--plot", "a.svg", *SMALL, "--table", "a.md")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: The style leaves no room for what is drawn.\n")
    assert left() == ["small.mplstyle", "tiny.json"]


@pytest.mark.usefixtures("undrawable")
def test_a_figure_that_fails_loses_nothing_else(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--episodes", 1, "--plot", "a.svg", "--table", "a.md")
    assert answer.code == 1
    assert "mean reward" in answer.out
    assert answer.err == (
        "table written to a.md\nError: The style leaves no room.\n  Give it more.\n"
    )
    assert Path("a.md").exists()


@pytest.mark.usefixtures("undrawable")
def test_a_calibration_is_shown_before_its_figure_is_drawn(qcompile: Call) -> None:
    words = ("calibrate", "--backend", "fake_lima", "--shots", 100, "--table", "a.md")
    answer = qcompile(*words, "--plot", "a.svg")
    assert answer.code == 1
    assert answer.out.endswith("calibration written to fake_lima-calibration.json\n")
    assert answer.err.startswith("table written to a.md\nError: The style leaves no room.\n")


def test_all_that_went_wrong_is_in_one_message(
    qcompile: Call, policy: Call, ctrl_c: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An interrupted run whose table cannot be written either."""

    def save(*_: object) -> None:
        raise FigureError("The table is too long.")

    monkeypatch.setattr("qcompile.report.table.Table.save", save)
    ctrl_c(2)
    answer = qcompile("run", policy(), "--episodes", 5, "--table", "a.md", "--report", "a.html")
    assert answer.code == 1
    assert "report written to a.html\n" in answer.err
    message = answer.err[answer.err.index("Error: ") :]
    assert message.startswith("Error: Interrupted: 2 of 5 episodes finished.\n")
    assert message.endswith("\n  The table is too long.\n")


def test_a_defect_is_not_hidden_and_the_rest_is_saved(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.verbs.run_result.draw_rewards", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        qcompile("run", policy(), "--episodes", 1, "--plot", "a.svg", "--table", "a.md")
    assert Path("a.md").exists()


def test_a_grid_without_a_cell_says_why_and_keeps_what_was_there(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "qcompile.sweep.evaluation.run.run_cell",
        lambda cell: CellFailure(cell.name, "The environment is closed."),
    )
    Path("a.md").write_text("of yesterday")
    words = ("evaluate", policy(), "--backend", "ideal", "--shots", "exact", "--workers", 1)
    answer = qcompile(*words, "--mitigation", "none", "--episodes", 2, *ALL)
    assert answer.code == 1
    assert answer.err.endswith(
        "report written to a.html\n"
        "Error: 1 of 1 cells could not be played.\n"
        "  tiny-ideal-exact-none-level2-episodes2-seed0: The environment is closed.\n"
        "  There is nothing to draw: no cell could be played.\n"
        "  The table has no rows: a.md was not written.\n"
    )
    assert "The environment is closed." in Path("a.html").read_text()
    assert Path("a.md").read_text() == "of yesterday"


@pytest.mark.parametrize(
    "words",
    [
        *(("--table", "a.md"), ("--plot", "a.svg"), ("--report", "a.html"), ("--page", "a.md")),
        *(("--workers", 1), ("--engine", "dask"), ("--address", "here")),
    ],
)
def test_a_list_of_rows_takes_no_option_that_it_does_not_use(
    qcompile: Call, left: Call, words: tuple[object, ...]
) -> None:
    answer = qcompile("study", "paper", "--list", *words)
    assert (answer.code, answer.out, left()) == (2, "", [])
    assert f"{words[0]} cannot be used with --list: nothing is trained." in answer.err


def test_circuits_that_there_are_not_are_named_before_anything_is_shown(qcompile: Call) -> None:
    """Circuits of a program have the numbers of its qubits."""
    Path("c.qasm").write_text(
        'OPENQASM 2.0;\ninclude "qelib1.inc";\nqreg q[6];\ncreg c[6];\n'
        "h q[2];\nx q[5];\nmeasure q[2] -> c[2];\nmeasure q[5] -> c[5];\n"
    )
    answer = qcompile("show", "c.qasm", "--draw", "c.svg", "--circuit", 0)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err == "Error: There is no circuit 0.\n  There are circuits 2, 5.\n"
    answer = qcompile("show", "c.qasm", "--draw", "c.qasm/c.svg")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: Cannot write c.qasm/c.svg.\n")
