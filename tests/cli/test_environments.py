"""--env and --import on the command line."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import click
import pytest

from qcompile.deploy import registration

Call = Callable[..., Any]


@pytest.mark.parametrize("name", ["train", "run", "evaluate", "plan", "validate"])
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("false", False),
        ("0.5", 0.5),
        ("8x8", "8x8"),
        ('["SF", "FG"]', ["SF", "FG"]),
        ('"8"', "8"),
        ("null", None),
        ("a=b", "a=b"),
        ("NaN", "NaN"),
        ("", ""),
        ("[1,", "[1,"),
    ],
)
def test_a_value_is_json_or_else_a_text(name: str, text: str, value: object) -> None:
    command: click.Command = import_module(f"qcompile.cli.{name}").command
    least = {"train": ["CartPole-v1", "--out", "p.pt"], "validate": ["lima.json"]}
    words = [*least.get(name, []), "--env", f"x={text}", "--env", "y=1", "--import", "a.b"]
    names = ["-h", "--help"]
    values = command.make_context(name, words, help_option_names=names).params
    assert values["env"] == {"x": value, "y": 1}
    assert values["imports"] == ("a.b",)


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A module that prints when it is imported."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registration, "_imported", {})
    monkeypatch.setattr("sys.path", [*sys.path])
    Path("talk_cli.py").write_text("print('hello')\n")
    yield "talk_cli.py"
    sys.modules.pop("talk_cli", None)


def test_a_document_stays_one_where_a_module_prints(qcompile: Call, module: str) -> None:
    answer = qcompile(
        *("run", "cartpole", "--import", module, "--episodes", 1, "--max-steps", 1, "--json")
    )
    assert answer.json()["policy"] == "cartpole"
    assert answer.err.startswith("hello\n")


def test_an_interrupted_training_says_how_to_resume_with_the_module(
    qcompile: Call, module: str, ctrl_c: Call
) -> None:
    ctrl_c(1)
    words = ("train", "CartPole-v1", "--preset", "paper", "--episodes", 5, "--import", module)
    answer = qcompile(*words, "--checkpoint", "state", "--out", "p.pt")
    assert answer.code == 1
    line = "Resume with: qcompile train CartPole-v1 --import talk_cli.py --resume state --out p.pt"
    assert line in answer.err
