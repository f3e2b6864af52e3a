"""Arguments of results and drawings that have the wrong type, refused in words."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

import qcompile
from qcompile.errors import FigureError
from qcompile.verbs.run_result import RunResult

PROGRAM: Any = qcompile.load_policy("cartpole").program


@pytest.fixture(scope="module")
def result() -> RunResult:
    return qcompile.run("cartpole", episodes=1, max_steps=1, progress=False)


@pytest.mark.parametrize("path", [None, 3, {}, b"a.html", "a\0.html"])
def test_a_path_is_a_name_or_a_path(result: Any, path: Any) -> None:
    calibration = qcompile.calibrate("fake_lima", [0], 1000, progress=False)
    for write in (
        *(result.save, result.report, result.table().save, result.plot().save),
        *(calibration.save, calibration.report),
    ):
        with pytest.raises(qcompile.OptionError, match=r"^path cannot be "):
            write(path)


@pytest.mark.parametrize("style", [3, {"font.size": 7}, b"a.mplstyle"])
def test_a_style_is_a_style_or_its_file(result: Any, style: Any) -> None:
    with pytest.raises(qcompile.OptionError, match=r"^style cannot be of type \w+\.\n"):
        result.plot(style=style)


def test_the_command_of_a_report_is_text(result: Any) -> None:
    with pytest.raises(qcompile.OptionError, match=r"^command cannot be of type int\."):
        result.report("a.html", command=3)


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (lambda: PROGRAM.draw([]), "There is no form []."),
        (lambda: PROGRAM.draw("text", True), "circuit cannot be of type bool."),
        (lambda: PROGRAM.draw("text", "0"), "circuit cannot be of type str."),
        (lambda: PROGRAM.draw("text", 9), "There is no circuit 9.\n  There are circuits 0 to 3."),
    ],
)
def test_a_drawing_has_a_form_and_a_number(draw: Callable[[], object], words: str) -> None:
    with pytest.raises(FigureError, match=f"^{re.escape(words)}"):
        draw()


def test_options_are_named_as_in_python() -> None:
    with pytest.raises(qcompile.OptionError, match=r"^keep needs within, "):
        qcompile.plan("cartpole", keep=0.5, progress=False)
    with pytest.raises(qcompile.OptionError, match=r"^evaluate_episodes needs evaluate_every\."):
        qcompile.train("CartPole-v1", evaluate_episodes=3)
