"""The command of a plan plays its settings."""

from __future__ import annotations

import shlex
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import qcompile
from qcompile.cli.run import command
from qcompile.deploy.settings import RunSettings
from qcompile.execution import Workload, load_backend
from qcompile.planning.chains import Chains
from qcompile.planning.command import run_command
from qcompile.planning.point import Point
from qcompile.planning.search import SearchResult
from qcompile.planning.share import Baseline
from qcompile.planning.simulation import Simulated
from qcompile.policy import load_circuits

DEVICE = load_backend("fake_toronto").device


def point(cut: int | None = None, speculate: Any = "auto", **settings: Any) -> Point:
    simulated = Simulated(
        DEVICE,
        RunSettings.of(**settings).resolved(DEVICE),
        np.ones(3),
        np.ones(3, dtype=int),
        Chains(np.ones((3, 1), dtype=bool), np.ones(3, dtype=int)),
        1,
        Workload(1, 100),
    )
    baseline = Baseline(np.zeros(2), np.ones(3))
    return Point(load_circuits("cartpole"), simulated, baseline, 12, speculate, cut)


@pytest.mark.parametrize(
    "found",
    [
        point(shots=64, copies=6, calibration_shots=256),
        point(shots=64, copies=6, split=True, calibration_shots="auto", seed=10000),
        point(shots=8, copies=1, speculate=16, cut=295, level=1),
        point(shots=8, mitigation="none"),
    ],
)
def test_the_command_has_the_settings_of_the_point(found: Point) -> None:
    words = run_command(found, "cartpole", "fake_toronto")
    assert words.split() == shlex.split(words)  # no quotes
    assert words.startswith("qcompile run cartpole --backend fake_toronto --episodes 12 ")
    values = command.make_context("run", words.split()[2:]).params
    settings = found.settings
    for name in ("shots", "split", "speculate", "max_steps", "seed", "level"):
        assert values[name] == getattr(settings, name), name
    assert values["calibration_shots"] == settings.calibration_shots
    assert (values["copies"] or 1) == (settings.copies or 1)
    resolved = RunSettings(mitigation=values["mitigation"]).resolved(DEVICE)
    assert resolved.mitigation == settings.mitigation
    assert values["episodes"] == found.episodes
    assert not values["live"]


def test_names_that_a_shell_would_split_are_quoted() -> None:
    env = {"is_slippery": False, "map_name": "8x8"}
    words = run_command(point(shots=8), "my policy.pt", "fake_toronto", ["envs.py"], env)
    assert shlex.split(words)[2] == "my policy.pt"
    assert words.endswith("--import envs.py --env is_slippery=false --env map_name=8x8")


@pytest.mark.parametrize("given", [None, "file", "object"])
def test_a_plan_names_no_command_for_an_object(
    given: str | None, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def search(policies: Any, backend: Any, goal: Any, show: Any) -> SearchResult:
        chosen = replace(point(shots=64), policy=policies[0], episodes=3)
        return SearchResult(goal, [chosen], chosen)

    monkeypatch.setattr(import_module("qcompile.verbs.plan"), "search", search)
    calibration: Any = None
    if given is not None:
        calibration = qcompile.calibrate("fake_lima", shots=256, parts=["readout"])
    if given == "file":
        calibration.save(file := tmp_path / "lima.json")
        calibration = file
    found = qcompile.plan(
        "cartpole", "fake_lima", calibration=calibration, within=600, max_steps=2, progress=False
    )
    assert found.recommended is not None
    assert (found.recommended["command"] is None) == (given == "object")


@pytest.mark.parametrize("value", ["true", "8", " 8x8 ", "8x8", "", "null", 8, [1, "a"]])
def test_arguments_of_the_environment_are_read_as_they_were(value: Any) -> None:
    words = run_command(point(shots=8), "cartpole", "fake_toronto", env={"size": value})
    assert command.make_context("run", shlex.split(words)[2:]).params["env"] == {"size": value}
