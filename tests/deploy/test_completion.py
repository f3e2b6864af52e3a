"""Completed cut episodes: on a noise model exactly as if they had not been cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from fresh import FreshExecutor
from gymnasium.spaces import Box, Discrete

from qcompile.deploy import completion
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.network import NetworkPlayer
from qcompile.deploy.play import play
from qcompile.deploy.rows import Rows
from qcompile.device import load_device
from qcompile.execution import OfflineExecutor, TwinExecutor
from qcompile.mitigation import calibrate
from qcompile.policy import Dense, Network, load_circuits

Make = Callable[..., Any]

EPISODES, SEED = 6, 20


def rewards(playing: Any) -> list[float]:
    return play(playing, EPISODES).rewards.tolist()


def completed(playing: Any) -> Any:
    """The run, completed; some of its episodes are cut."""
    run = play(playing, EPISODES, complete=True)
    assert run.cut_episodes > 0
    return run


SETTINGS: dict[str, dict[str, Any]] = {
    "plain": {"mitigation": "none"},
    "mitigated": {"mitigation": "readout"},
    "copies": {"mitigation": "readout", "copies": 3},
    "predistorted": {"predistort": True, "mitigation": "none"},
    "greedy": {"mitigation": "none", "greedy": True},
    "exact": {"mitigation": "none", "shots": None},
}


@pytest.mark.parametrize("most", [1, 5, 13])
@pytest.mark.parametrize("hold", [1, 3, 4])
def test_a_completed_run_is_the_uncut_run(cartpole: Make, hold: int, most: int) -> None:
    """Cut between two decisions or within one."""
    policy, settings = replace(cartpole(), hold=hold), {"shots": 16, "seed": SEED}
    uncut = rewards(Deployment(policy, "fake_lima", mitigation="none", **settings))
    run = completed(Deployment(policy, "fake_lima", mitigation="none", max_steps=most, **settings))
    assert run.completed.tolist() == uncut
    assert run.rewards.tolist() == [min(reward, most) for reward in uncut]
    summary = run.summary()
    assert summary["mean_reward_completed"] == np.mean(uncut)
    assert summary["mean_reward"] == np.mean(run.rewards)
    assert summary["ci95_completed"] != summary["ci95"]
    assert summary["env_steps"] == sum(min(reward, most) for reward in uncut)


@pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)
def test_with_every_setting(cartpole: Make, settings: dict[str, Any]) -> None:
    given = {"shots": 16, "seed": SEED} | settings
    device = "fake_toronto" if "copies" in settings else "fake_lima"
    policy = replace(cartpole(), hold=2)
    uncut = rewards(Deployment(policy, device, **given))
    assert completed(Deployment(policy, device, max_steps=15, **given)).completed.tolist() == uncut


def test_on_a_twin_it_is_the_uncut_run_of_the_twin(cartpole: Make) -> None:
    calibration = calibrate(OfflineExecutor(load_device("fake_lima"), 3), np.arange(5), 1000)
    given: dict[str, Any] = {"shots": 16, "seed": SEED}
    uncut = rewards(Deployment(cartpole(), TwinExecutor(calibration), **given))
    cut = Deployment(cartpole(), TwinExecutor(calibration), max_steps=15, **given)
    assert completed(cut).completed.tolist() == uncut


def test_of_a_network_too() -> None:
    layers = [Dense(np.array([[0, 0, -1.0, -0.3], [0, 0, 1, 0.3]]), np.zeros(2), "none")]
    network = Network("net", "CartPole-v1", layers, hold=2)
    uncut = rewards(NetworkPlayer(network, seed=SEED))
    assert completed(NetworkPlayer(network, seed=SEED, max_steps=7)).completed.tolist() == uncut


def test_box2d_goes_on_as_well() -> None:
    policy = load_circuits("lunarlander")
    given: dict[str, Any] = {"shots": 64, "mitigation": "none", "seed": 1}
    uncut = play(Deployment(policy, "fake_toronto", **given), 2).rewards.tolist()
    run = play(Deployment(policy, "fake_toronto", max_steps=150, **given), 2, complete=True)
    assert run.completed is not None
    assert run.completed.tolist() == uncut


class Kept:
    """The episodes and the actions of every decision."""

    def __init__(self) -> None:
        self.actions: list[dict[int, int]] = []

    def act(self, act: Any, observations: Any, rows: Rows) -> Any:
        actions = act(observations, rows)
        self.actions.append(dict(zip(rows.episode.tolist(), actions.tolist(), strict=True)))
        return actions

    def rewards(self, rewards: list[float]) -> None:
        """The actions are enough."""


@pytest.mark.parametrize("mitigation", ["none", "readout"])
def test_a_machine_is_followed_by_the_noise_model_of_its_device(
    cartpole: Make, mitigation: str
) -> None:
    """By hand: the machine's actions again, then a deployment on the noise model, row by row."""
    policy, recorder = replace(cartpole(), hold=3), Kept()
    settings: dict[str, Any] = {"shots": 16, "seed": SEED, "mitigation": mitigation}
    executor = FreshExecutor(load_device("fake_lima"))
    machine = Deployment(policy, executor, max_steps=7, **settings)
    of_calibration = executor.rows
    run = play(machine, EPISODES, complete=True, recorder=recorder)
    assert executor.rows == of_calibration + sum(map(len, recorder.actions)), "no more is measured"
    on_model = Deployment(policy, "fake_lima", **settings)
    expected = []
    for episode in range(EPISODES):
        environment = gymnasium.make("CartPole-v1")
        seen, _ = environment.reset(seed=SEED + episode)
        total, done, decision = 0.0, False, 0
        while not done:
            if decision < len(recorder.actions):
                action = recorder.actions[decision][episode]
            else:
                row = Rows(np.array([episode]), np.array([decision]))
                (action,) = on_model.act(seen[None].astype(float), row).tolist()
            for _ in range(3):
                seen, paid, terminated, truncated, _ = environment.step(action)
                total, done = total + float(paid), terminated or truncated
                if done:
                    break
            decision += 1
        environment.close()
        expected.append(total)
    assert len(recorder.actions) == 3
    assert run.cut_episodes == EPISODES
    assert run.completed is not None
    assert run.completed.tolist() == expected


def test_without_a_cut_nothing_is_completed(cartpole: Make, deploy: Make) -> None:
    for playing in (deploy(cartpole()), deploy(cartpole(), max_steps=600)):
        run = play(playing, 2, complete=True)
        assert (run.cut_episodes, run.completed) == (0, None)
        assert run.summary()["mean_reward_completed"] is run.summary()["ci95_completed"] is None


def test_it_costs_nothing(cartpole: Make, deploy: Make) -> None:
    """Jobs, executions and steps count only the part before the cut."""
    found = [
        play(deploy(cartpole(), shots=16, max_steps=5), 3, complete=complete).summary()
        for complete in (False, True)
    ]
    own = ("wall_seconds", "mean_reward_completed", "ci95_completed")
    first, second = ({k: v for k, v in f.items() if k not in own} for f in found)
    assert first == second


class Endless(gymnasium.Env[Any, Any]):
    """Never ends; it fails after `fails` steps, and Ctrl-C is pressed after `stops`."""

    def __init__(self, fails: int = 0, stops: int = 0):
        self.observation_space, self.action_space = Box(0, 1, (1,), np.float32), Discrete(2)
        self.fails, self.stops = fails, stops

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.steps = 0
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> Any:
        self.steps += 1
        if self.steps == self.fails:
            raise ZeroDivisionError
        if self.steps == self.stops:
            raise KeyboardInterrupt
        return np.zeros(1, np.float32), 1.0, False, False, {}


@pytest.fixture
def endless() -> Iterator[str]:
    gymnasium.register("Endless-v0", Endless)
    yield "Endless-v0"
    del gymnasium.registry["Endless-v0"]


@pytest.mark.parametrize("arguments", [{}, {"fails": 6}, {"stops": 6}])
def test_what_cannot_be_completed_leaves_the_run_as_it_is(
    stubborn: Make,
    deploy: Make,
    endless: str,
    arguments: dict[str, int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """No end within MOST_STEPS, a failure, Ctrl-C: the played and paid episodes are kept."""
    monkeypatch.setattr(completion, "MOST_STEPS", 50)
    policy = replace(stubborn(endless, 1, 2), environment_kwargs=arguments)
    run = play(deploy(policy, max_steps=3), 2, complete=True)
    assert (run.completed, run.cut_episodes, run.interrupted) == (None, 2, False)
    assert run.rewards.tolist() == [3.0, 3.0]


def test_an_interrupted_run_is_not_completed(cartpole: Make, deploy: Make) -> None:
    def stop(episode: Any) -> None:
        raise KeyboardInterrupt

    run = play(deploy(cartpole(), max_steps=3), 2, complete=True, on_episode=stop)
    assert run.interrupted
    assert run.completed is None
