"""A live run in an environment from a user's module: its journal has only the id."""

from __future__ import annotations

import sqlite3
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import pytest
from live_runs import LIMIT_S, Runs, played

from qcompile.deploy import registration
from qcompile.policy import save_policy

MODULE = """
import gymnasium

class Hall(gymnasium.Env):
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self, steps=2):
        self.observation_space = gymnasium.spaces.Discrete(steps + 1)
        self.steps = steps

    def reset(self, *, seed=None, options=None):
        self.count = 0
        return 0, {}

    def step(self, action):
        self.count += 1
        return self.count, 1.0, self.count == self.steps, False, {}

gymnasium.register("Hall-v0", Hall)
"""


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget the module, as in another process."""
    gymnasium.registry.pop("Hall-v0", None)
    sys.modules.pop("halls", None)
    monkeypatch.setattr(registration, "_imported", {})


@pytest.fixture(autouse=True)
def module(empty_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (empty_folder / "halls.py").write_text(MODULE)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield
    forget(monkeypatch)


def test_it_is_played_planned_and_resumed_with_the_module(
    runs: Runs, stubborn: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    save_policy(stubborn("Hall-v0", 3, 2), "hall.json")
    own = ("--import", "halls.py")
    plan = runs.call("plan", "hall.json", *own, "--backend", "fake_lima", "--json")
    assert plan.json()["env_steps"] == 2
    words: tuple[Any, ...] = ("run", "hall.json", "--backend", "fake_lima", "--live", "--yes")
    words += ("--mitigation", "none", "--shots", 64, "--episodes", 2, "--env", "steps=2")
    answer = runs.call(*words, *own, "--max-qpu-seconds", LIMIT_S, "--json")
    assert answer.code == 0, answer.err
    first = answer.json()
    assert (first["mean_reward"], first["environment_kwargs"]) == (2.0, {"steps": 2})
    [path] = Path("runs").glob("*/journal.sqlite")
    with sqlite3.connect(path) as db:
        assert "halls" not in "\n".join(db.iterdump())
        db.execute("UPDATE run SET result = NULL")
    forget(monkeypatch)
    unknown = runs.call("resume", "last", "--yes")
    assert unknown.code == 1
    assert "Unknown environment 'Hall-v0'." in unknown.err
    assert "--import MODULE" in unknown.err
    again = runs.call("resume", "last", "--yes", *own, "--json")
    assert again.code == 0, again.err
    assert played(again.json()) == played(first)


def test_arguments_that_a_journal_could_not_keep_are_refused(runs: Runs) -> None:
    answer = runs.run("--env", "track=../a.xml")
    assert answer.code == 2
    assert "env cannot be stored in a policy file: track has the string '../a.xml'" in answer.err
    assert not Path("runs").exists()
