"""Arguments of environments that a user names, and modules of his own, in the verbs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

import qcompile
from qcompile.deploy import registration
from qcompile.errors import EnvironmentMismatchError, OptionError, QcompileError
from qcompile.rl.checkpoint import load_checkpoint

SHORT: dict[str, Any] = {"preset": "paper", "episodes": 2}
OTHER = {"max_episode_steps": 9, "sutton_barto_reward": True}


def test_a_training_keeps_its_arguments(tmp_path: Path) -> None:
    """Nine steps at most, each of which pays 0, but for -1 where the pole falls."""
    state, out = tmp_path / "state", tmp_path / "p.json"
    training = qcompile.train("CartPole-v1", env=OTHER, out=out, checkpoint=state, **SHORT)
    assert max(training.rewards) <= 0
    assert training.to_dict()["environment_kwargs"] == OTHER
    written = json.loads(out.read_text())
    assert (written["format"], written["environment_kwargs"]) == ("qcompile-policy-2", OTHER)
    assert written["metadata"]["environment_kwargs"] == OTHER
    trainer, _ = load_checkpoint(state)
    assert trainer.arguments == OTHER
    again = qcompile.train("CartPole-v1", resume=state, out=out, evaluate_every=1)
    assert again.policy is not None
    assert again.policy.environment_kwargs == OTHER
    played = qcompile.run(out, shots="exact", episodes=3).to_dict()
    assert played["environment_kwargs"] == OTHER
    assert max(episode["length"] for episode in played["episodes"]) <= 9


def test_without_arguments_nothing_is_said_of_them(tmp_path: Path) -> None:
    out = tmp_path / "p.json"
    training = qcompile.train("CartPole-v1", out=out, **SHORT)
    assert "environment_kwargs" not in training.to_dict()
    assert json.loads(out.read_text())["format"] == "qcompile-policy-1"
    assert "environment_kwargs" not in qcompile.run(out, episodes=1, max_steps=1).to_dict()


def test_a_checkpoint_of_before_has_none(tmp_path: Path) -> None:
    state = tmp_path / "state"
    training = qcompile.train("CartPole-v1", checkpoint=state, **SHORT)
    saved = torch.load(state, weights_only=True)
    del saved["arguments"]
    torch.save(saved, state)
    resumed = qcompile.train("CartPole-v1", resume=state)
    assert resumed.rewards == training.rewards


@pytest.mark.parametrize("arguments", ['{"env_id": "os:system"}', '{"id": "a"}', "[]", "{", "1"])
def test_a_checkpoint_loads_no_code_by_its_arguments(tmp_path: Path, arguments: str) -> None:
    state = tmp_path / "state"
    qcompile.train("CartPole-v1", checkpoint=state, **SHORT)
    saved = torch.load(state, weights_only=True)
    torch.save(saved | {"arguments": arguments}, state)
    with pytest.raises(QcompileError, match=f"Checkpoint {state} is damaged"):
        load_checkpoint(state)


def test_single_arguments_are_changed_over_those_of_the_policy() -> None:
    policy = qcompile.train("CartPole-v1", env=OTHER, **SHORT).policy
    assert policy is not None
    both = {"max_episode_steps": 4, "sutton_barto_reward": True}
    changed = {"max_episode_steps": 4}
    result = qcompile.run(policy, episodes=2, env=changed).to_dict()
    assert result["environment_kwargs"] == both
    assert max(episode["length"] for episode in result["episodes"]) <= 4
    grid = qcompile.evaluate(policy, "ideal", shots=8, episodes=2, env=changed, workers=1)
    assert [cell["environment_kwargs"] for cell in grid.cells] == [both, both]
    assert qcompile.plan(policy, env=changed).to_dict()["env_steps"] <= 4
    assert policy.environment_kwargs == OTHER


def test_solved_is_judged_as_gymnasium_says(stubborn: Callable[..., Any], tmp_path: Path) -> None:
    """Nobody slips: the third cell is reached, or the hole before it."""
    arguments = {"is_slippery": False, "desc": ["SFG"]}
    made = gymnasium.make("FrozenLake-v1", **arguments)
    assert made.spec is not None
    assert made.spec.reward_threshold == 0.7
    right = stubborn("FrozenLake-v1", 3, 4, choice=2)
    for env, solved in ((arguments, True), ({**arguments, "desc": ["SHG"]}, False)):
        grid = qcompile.evaluate(
            right, "ideal", shots="exact", episodes=100, env=env, workers=1, out=tmp_path
        )
        assert [cell["solved"] for cell in grid.cells] == [solved]
        again = qcompile.evaluate(
            right, "ideal", shots="exact", episodes=100, env=env, workers=1, out=tmp_path
        )
        assert again.there == 1, "what is stored is judged by the same threshold"


@pytest.mark.parametrize(
    ("env", "words"),
    [
        ({"id": "a"}, "env id: this is not an argument of an environment."),
        ({"render_mode": "human"}, "env render_mode: this is not an argument"),
        ({"a b": 1}, "env a b: this is not an argument"),
        ({"a": np.zeros(2)}, "env a is array"),
        ({"a": (1, 2)}, r"env a is \(1, 2\)."),
        ({"a": float("nan")}, "env a is nan."),
        ({"a": object}, "env a is <class 'object'>."),
    ],
)
@pytest.mark.parametrize("verb", ["train", "run", "evaluate", "plan"])
def test_arguments_are_plain_values(verb: str, env: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        getattr(qcompile, verb)("CartPole-v1" if verb == "train" else "cartpole", env=env)


def test_what_a_policy_file_could_not_keep_is_refused_before_training() -> None:
    env = {"file": "../track.xml"}
    for verb, name in (("train", "CartPole-v1"), ("plan", "cartpole")):
        with pytest.raises(OptionError) as error:
            getattr(qcompile, verb)(name, env=env)
        assert str(error.value).startswith(
            "env cannot be stored in a policy file: file has the string"
        )
    with pytest.raises(EnvironmentMismatchError, match="cannot be made"):  # it is his word
        qcompile.run("cartpole", env=env)


def test_a_resumed_training_has_its_arguments(tmp_path: Path) -> None:
    state = tmp_path / "state"
    qcompile.train("CartPole-v1", checkpoint=state, **SHORT)
    with pytest.raises(OptionError, match="env cannot be combined with resume"):
        qcompile.train("CartPole-v1", resume=state, env=OTHER)


def test_a_class_is_trained_and_played_in_this_process() -> None:
    try:
        training = qcompile.train(Numbered, steps=64, preset="paper")
        assert training.policy is not None
        assert training.policy.environment == "Numbered-v0"
        assert training.policy.name == "trained-numbered"
        assert qcompile.run(training.policy, episodes=2).mean_reward == 2.0
    finally:
        gymnasium.registry.pop("Numbered-v0", None)
        registration._registered.pop("Numbered-v0", None)


class Numbered(gymnasium.Env[Any, Any]):
    """Two states from 5 on, two steps, and 1 for each."""

    observation_space = gymnasium.spaces.Discrete(2, start=5)
    action_space = gymnasium.spaces.Discrete(2, start=1)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.state = 5
        return self.state, {}

    def step(self, action: Any) -> Any:
        assert action in self.action_space
        self.state += 1
        return min(self.state, 6), 1.0, self.state == 7, False, {}


def test_a_file_never_imports_the_module_of_its_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Gymnasium would import what stands before a colon."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "harm.py").write_text("raise SystemExit('harm')\n")
    state, out = tmp_path / "state", tmp_path / "p.json"
    qcompile.train("CartPole-v1", out=out, checkpoint=state, **SHORT)
    harm = {"environment": "harm:CartPole-v1"}
    out.write_text(json.dumps(json.loads(out.read_text()) | harm))
    torch.save(torch.load(state, weights_only=True) | harm, state)
    for use in (qcompile.run, qcompile.evaluate, qcompile.plan):
        with pytest.raises(EnvironmentMismatchError, match="would import a module"):
            use(out)
    with pytest.raises(EnvironmentMismatchError, match="would import a module"):
        load_checkpoint(state)
