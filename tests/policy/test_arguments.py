"""Arguments of environments in a policy file: they reach the environment, and load no code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.environments import check_fit, make_environments
from qcompile.deploy.play import play
from qcompile.errors import EnvironmentMismatchError, PolicyError
from qcompile.policy import load_policy
from qcompile.policy.arguments import check_arguments

Make = Callable[..., Any]


def test_arguments_reach_the_environment(tmp_path: Path, values: Make, write_json: Make) -> None:
    """CartPole as Sutton and Barto have it: 0 for a step, -1 for the one that ends it."""
    document = values() | {
        "format": "qcompile-policy-2",
        "environment_kwargs": {"sutton_barto_reward": True, "max_episode_steps": 7},
    }
    policy = load_policy(write_json(tmp_path / "p.json", document))
    found = play(Deployment(policy, "ideal", greedy=True, seed=1), 2)
    lengths = [episode.length for episode in found.episodes]
    assert max(lengths) <= 7
    plain = play(
        Deployment(replace(policy, environment_kwargs={}), "ideal", greedy=True, seed=1), 2
    )
    fallen = [episode.length <= 7 for episode in plain.episodes]
    assert [episode.reward for episode in found.episodes] == [-1.0 * over for over in fallen]


def test_an_environment_without_such_an_argument_is_explained() -> None:
    with pytest.raises(EnvironmentMismatchError, match=r"'CartPole-v1' cannot be made\.\n.*wind"):
        make_environments("CartPole-v1", 1, arguments={"wind": 3})


@pytest.mark.parametrize(
    "arguments",
    [
        {"is_slippery": False, "map_name": "8x8", "desc": ["SF", "FG"], "level": None},
        {"gravity": -9.5, "max_episode_steps": 3, "options": {"wind power": [1, 2.5]}},
        {},
    ],
)
def test_plain_arguments_pass(arguments: dict[str, Any]) -> None:
    assert check_arguments(arguments) == arguments


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"env_id": "evil:Env-v0"},
            "env_id has the string 'evil:Env-v0': strings may have letters",
        ),
        ({"vehicle": {"type": "evil.Vehicle"}}, "vehicle has the string 'evil.Vehicle'"),
        ({"options": [[{"a/b": 1}]]}, "options has the string 'a/b'"),
        ({"xml": "~"}, "xml has the string"),
        ({"name": "caf\u00e9"}, "name has the string"),
        ({"name": "two\nlines"}, "name has the string"),
        ({"name": "a" * 201}, "name has the string"),
        ({"id": "CartPole-v1"}, "'id' is not an argument that a policy file may set"),
        ({"render_mode": "human"}, "'render_mode' is not an argument"),
        ({"disable_env_checker": False}, "'disable_env_checker' is not an argument"),
        ({"not a name": 1}, "'not a name' is not an argument"),
        ({"gravity": float("nan")}, "gravity has a number that is not finite"),
        ({"max_episode_steps": -1}, "max_episode_steps is not a whole number of at least 1"),
        ({"max_episode_steps": True}, "max_episode_steps is not a whole number of at least 1"),
    ],
)
def test_arguments_that_may_load_something_are_refused(
    tmp_path: Path, arguments: dict[str, Any], message: str, values: Make, write_json: Make
) -> None:
    document = values() | {"format": "qcompile-policy-2", "environment_kwargs": arguments}
    path = write_json(tmp_path / "p.json", document)
    with pytest.raises(PolicyError, match=f"environment_kwargs: {message}"):
        load_policy(path)


def test_bits_are_read_of_a_number_alone(tmp_path: Path, values: Make, write_json: Make) -> None:
    """FrozenLake's 16 states have four bits."""
    encoder = {"function": "bits", "feature": [0, 2], "scale": [1, 1]}
    document = values() | {"format": "qcompile-policy-2", "encoder": encoder}
    policy = load_policy(write_json(tmp_path / "p.json", document))
    np.testing.assert_array_equal(policy.encode([[4.0], [1.0]]), [[0, np.pi], [np.pi, 0]])
    (cart_pole,) = make_environments("CartPole-v1", 1, bits=True)
    with pytest.raises(EnvironmentMismatchError, match="reads the bits of a number; CartPole-v1"):
        check_fit(policy, cart_pole)
    (lake,) = make_environments("FrozenLake-v1", 1, bits=True)
    with pytest.raises(EnvironmentMismatchError, match="has 2 actions; FrozenLake-v1 has 4"):
        check_fit(policy, lake)
    for bit, message in ((3, "has 2 actions"), (4, "reads bit 4; .* FrozenLake-v1 have 4 bits")):
        other = replace(policy, encoder=replace(policy.encoder, feature=np.array([0, bit])))
        with pytest.raises(EnvironmentMismatchError, match=message):
            check_fit(other, lake)
