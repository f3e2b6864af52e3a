"""What the page about entangling gates trains and plays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sessions import blocks, words_of

import qcompile as package
from qcompile.policy import load_policy

PAGE = blocks("howto/entangling.md")


def test_the_policy_plays_on_a_noise_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (text,) = [block for language, block in PAGE if language == "json"]
    Path("pair.json").write_text(text)
    result = package.run("pair.json", "fake_lima", shots=256, progress=False)
    assert result.to_dict()["gates_per_circuit"]["cx"] == 1
    assert result.mean_reward is not None
    assert 400 < result.mean_reward <= 500


def test_its_trainings_are_typed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, qcompile: Callable[..., Any]
) -> None:
    """Each command as it stands, with a smaller budget: the last value of an option counts."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(next(block for language, block in PAGE if language == "py"), names)
    exec(next(block for language, block in PAGE if ".save(" in block), names)
    lines = [line for language, block in PAGE if not language for line in block.splitlines()]
    trainings = [line for line in lines if line.startswith("qcompile train")]
    assert len(trainings) == 3
    for line in trainings:
        answer = qcompile(*words_of(line)[1:], "--episodes", 1)
        assert answer.code == 0, answer.err
    (line,) = [line for line in lines if "run pole.json" in line]
    answer = qcompile(*words_of(line)[1:], "--episodes", 1, "--max-steps", 3, "--json")
    assert answer.json()["gates_per_circuit"]["cx"] > 0
    policies = {name: load_policy(f"{name}.json") for name in ("pole", "taught", "further")}
    assert policies["taught"].program.observables == names["program"].observables
    assert policies["further"].program == policies["pole"].program
