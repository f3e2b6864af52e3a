"""On noise models and twins a run that measures ahead is the run that does not, bit for bit.

Episodes, rewards, decisions and every action of every environment. `make speculation` does the same
in every combination.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from traced import blackjack, frozen_lake, traced

from qcompile.deploy.deployment import Deployment
from qcompile.device import load_device
from qcompile.execution import OfflineExecutor, TwinExecutor
from qcompile.mitigation import calibrate
from qcompile.policy import Policy, load_circuits

POLICIES: dict[str, Callable[[], Policy]] = {
    "acrobot": lambda: load_circuits("acrobot"),
    "cartpole": lambda: load_circuits("cartpole"),
    "lunarlander": lambda: load_circuits("lunarlander"),
    "FrozenLake": frozen_lake,
    "Blackjack": blackjack,
}


@cache
def twin() -> Any:
    device = load_device("fake_lagos")
    return calibrate(OfflineExecutor(device, 3), np.arange(len(device.qubits)), 2000)


def found(policy: Policy, backend: Any, episodes: int, **settings: Any) -> Any:
    """All that must be the same, and the run."""
    opened = TwinExecutor(twin()) if backend == "twin" else backend
    run, actions = traced(Deployment(policy, opened, **settings), episodes, complete=True)
    told = run.summary()
    names = ("mean_reward", "std_reward", "ci95", "solved", "decisions", "env_steps", "hold")
    names += ("cut_episodes", "mean_reward_completed")
    return (run.episodes, actions, {name: told[name] for name in names}), run


def check(policy: Policy, backend: Any, episodes: int, depth: Any, **settings: Any) -> None:
    plain, alone = found(policy, backend, episodes, **settings)
    ahead, run = found(policy, backend, episodes, speculate=depth, **settings)
    assert ahead == plain
    assert run.steps < alone.steps, "nothing was measured ahead"
    assert run.measured_rows > alone.measured_rows == run.decisions


PLAIN: dict[str, Any] = {"shots": 24, "mitigation": "readout", "seed": 11}


@pytest.mark.parametrize("depth", [16, "auto"])
@pytest.mark.parametrize("name", POLICIES)
def test_every_task(name: str, depth: Any) -> None:
    """On a noise model, cut where an episode is long."""
    by_chance = name in ("FrozenLake", "Blackjack")
    episodes, changes = (30, {"shots": 2}) if by_chance else (3, {"max_steps": 50})
    check(POLICIES[name](), "fake_lagos", episodes, depth, **PLAIN | changes)


TORONTO: dict[str, Any] = {"copies": 2, "device": "fake_toronto"}
WAYS: dict[str, tuple[int, Any, dict[str, Any]]] = {
    "none": (1, 5, {"mitigation": "none"}),
    "response": (2, 16, {"mitigation": "response"}),
    "predistort": (4, "auto", {"mitigation": "none", "predistort": True}),
    "greedy": (1, "auto", {"greedy": True}),
    "copies": (2, "auto", TORONTO),
    "split": (1, 16, TORONTO | {"split": True}),
    "split, held": (4, 5, TORONTO | {"split": True}),
    "twin": (2, 5, {"mitigation": None, "device": "twin"}),
    "twin, predistort": (1, 16, {"mitigation": "none", "predistort": True, "device": "twin"}),
}
"""Hold, D and settings."""


@pytest.mark.parametrize("way", WAYS)
def test_every_way_to_measure(way: str) -> None:
    hold, depth, changes = WAYS[way]
    settings = PLAIN | {"max_steps": 41} | changes
    device = settings.pop("device", "fake_lagos")
    policy = replace(load_circuits("cartpole"), hold=hold)
    check(policy, device, 3, depth, **settings)


def test_episodes_by_number_are_those_of_all(cartpole: Any) -> None:
    settings = PLAIN | {"speculate": 8, "max_steps": 60}
    run, actions = traced(Deployment(cartpole(), "fake_lagos", **settings), 6)
    some, taken = traced(Deployment(cartpole(), "fake_lagos", **settings), [1, 4])
    assert some.episodes == [run.episodes[1], run.episodes[4]]
    assert taken == {seed: actions[seed] for seed in (12, 15)}
