"""Networks that play: episodes as by gymnasium and torch, and settings they do not accept."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.network import NetworkPlayer
from qcompile.deploy.play import play, player
from qcompile.deploy.rows import Rows
from qcompile.device import IDEAL, load_device
from qcompile.errors import CountsError, EnvironmentMismatchError, OptionError
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate
from qcompile.policy import Dense, Network, load_circuits
from qcompile.streams.stream import Stream

RNG = np.random.default_rng(3)


def network(features: int = 4, actions: int = 2, environment: str = "CartPole-v1") -> Network:
    layers = [
        Dense(RNG.normal(size=(5, features)), RNG.normal(size=5), "tanh"),
        Dense(RNG.normal(size=(actions, 5)), np.zeros(actions)),
    ]
    return Network("net", environment, layers)


def modules(network: Network) -> torch.nn.Module:
    """The same in torch, in double precision."""
    parts: list[torch.nn.Module] = []
    for layer in network.layers:
        linear = torch.nn.Linear(*layer.weights.shape[::-1], dtype=torch.float64)
        linear.load_state_dict(
            {"weight": torch.tensor(layer.weights), "bias": torch.tensor(layer.bias)}
        )
        parts += [linear, *([torch.nn.Tanh()] if layer.activation == "tanh" else [])]
    return torch.nn.Sequential(*parts)


def by_torch(model: torch.nn.Module, seed: int) -> float:
    """The reward of a CartPole episode of the likeliest actions."""
    environment = gymnasium.make("CartPole-v1")
    observation, _ = environment.reset(seed=seed)
    total, ended = 0.0, False
    while not ended:
        with torch.no_grad():
            action = int(model(torch.tensor(observation, dtype=torch.float64)).argmax())
        observation, reward, terminated, truncated, _ = environment.step(action)
        total, ended = total + float(reward), terminated or truncated
    environment.close()
    return total


def test_greedy_episodes_are_those_of_gymnasium_and_torch() -> None:
    one = network()
    result = play(NetworkPlayer(one, greedy=True, seed=40), 5)
    assert result.rewards.tolist() == [by_torch(modules(one), 40 + i) for i in range(5)]


def test_actions_are_drawn_from_the_probabilities_of_torch() -> None:
    """By the stream of actions: the first whose cumulative probability exceeds its number."""
    one = network(actions=3)
    observations, episodes = RNG.normal(size=(200, 4)), np.arange(200)
    numbers = Stream(7, "actions").uniforms(episodes, np.full(200, 2))
    with torch.no_grad():
        p = torch.softmax(modules(one)(torch.tensor(observations)), dim=1).numpy()
    expected = (np.cumsum(p, axis=1) > numbers[:, None]).argmax(axis=1)
    found = NetworkPlayer(one, seed=7).act(observations, Rows.of(200, 2))
    assert found.tolist() == expected.tolist()
    assert len(set(expected)) == 3


def test_an_episode_repeats_alone() -> None:
    playing = NetworkPlayer(network(), seed=3)
    together = play(playing, 6)
    alone = play(playing, [4])
    assert vars(alone.episodes[0]) == vars(together.episodes[4])


def test_the_summary_has_the_keys_of_circuits_and_none_of_their_figures() -> None:
    circuits = play(Deployment(load_circuits("cartpole"), "ideal", max_steps=2), 2).summary()
    found = play(NetworkPlayer(network(), max_steps=2), 2).summary()
    assert [*found] == [*circuits]
    expected = {
        "policy": "net",
        "backend": "ideal",
        "kind": "ideal",
        "shots": "exact",
        "mitigation": "none",
        "predistort": False,
        "calibration": None,
        "calibration_misfits": [],
        "copies": 1,
        "gates_per_circuit": {"sx": 0, "rz": 0, "x": 0, "rx": 0},
        "couplings_per_circuit": 0,
        "circuits_per_step": 0,
        "observables_per_step": 0,
        "rounds_per_step": 0,
        "max_steps": 2,
        "jobs": 0,
        "executions": 0,
        "qpu_seconds_estimate": None,
        "env_steps": 4,
        "mean_reward": 2.0,
    }
    assert {key: found[key] for key in expected} == expected


def test_what_is_said_of_a_network_may_be_so() -> None:
    """It plays exactly, unmitigated and one at a time."""
    changes = {"shots": None, "mitigation": "none", "copies": 1, "level": 2, "predistort": False}
    playing = player(network(), IDEAL, **changes)
    assert repr(playing) == "NetworkPlayer(net)"
    assert playing.settings == NetworkPlayer(network()).settings


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"shots": 100}, "shots"),
        ({"level": 0}, "level"),
        ({"mitigation": "readout"}, "mitigation"),
        ({"predistort": True, "copies": 2}, "predistort or copies"),
        ({"shots": 9, "level": 1, "copies": 3}, "shots, level or copies"),
    ],
)
def test_settings_of_circuits_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(
        OptionError, match=f"^net is a network, not circuits: it does not accept {words}\\.\n  A"
    ):
        NetworkPlayer(network(), **changes)


def test_a_calibration_is_refused() -> None:
    executor = OfflineExecutor(load_device("ibm_lima"), seed=0)
    calibration = calibrate(executor, np.array([0]), 1024, parts=["readout"])
    with pytest.raises(OptionError, match="it does not accept calibration"):
        NetworkPlayer(network(), calibration=calibration)


def test_a_backend_with_noise_is_refused() -> None:
    with pytest.raises(OptionError, match="it does not accept backend ibm_lima"):
        player(network(), "ibm_lima")


def test_other_settings_are_checked_as_ever() -> None:
    with pytest.raises(CountsError, match="max_steps cannot be 0"):
        NetworkPlayer(network(), max_steps=0)


@pytest.mark.parametrize(
    ("one", "words"),
    [
        (network(5, 2), "maps 5 features to 2 actions; CartPole-v1 has 4 and 2"),
        (network(4, 3), "maps 4 features to 3 actions; CartPole-v1 has 4 and 2"),
    ],
)
def test_a_network_fits_its_environment_exactly(one: Network, words: str) -> None:
    with pytest.raises(EnvironmentMismatchError, match=words):
        play(NetworkPlayer(one), 1)
