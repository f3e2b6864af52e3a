"""Callbacks of `qcompile.train`: what they are told, how they end a training, what they raise."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from trackers import trackers

import qcompile
from qcompile.errors import OptionError, QcompileError

PAPER: dict[str, Any] = {"preset": "paper", "episodes": 6}
BLOCKS = re.findall(
    r"^```python\n(.*?)^```$",
    (Path(__file__).parents[2] / "docs/howto/callbacks.md").read_text(),
    re.MULTILINE | re.DOTALL,
)


class Told(list[tuple[dict[str, float], int]]):
    """A callback that keeps what it is told; `answers` are what it returns, then None."""

    def __init__(self, *answers: object):
        super().__init__()
        self.answers = [*answers]

    def __call__(self, scalars: Any, steps: int) -> object:
        self.append((dict(scalars), steps))
        return self.answers.pop(0) if self.answers else None

    def of(self, name: str) -> list[tuple[int, float]]:
        return [(steps, scalars[name]) for scalars, steps in self if name in scalars]


def test_a_callback_is_told_episodes_updates_and_evaluations() -> None:
    told = Told()
    training = qcompile.train("CartPole-v1", **PAPER, evaluate_every=3, callback=told)
    ended = [(episode["steps"], episode["reward"]) for episode in training.episodes]
    assert told.of("rollout/episode_reward") == ended
    rewards = [reward for _, reward in ended]
    averages = [value for _, value in told.of("rollout/average_20")]
    assert averages == pytest.approx([np.mean(rewards[: i + 1]) for i in range(6)])
    # With the preset paper every episode is an update.
    for name in ("actor_loss", "critic_loss", "entropy", "divergence", "clipped"):
        assert [steps for steps, _ in told.of(f"update/{name}")] == [steps for steps, _ in ended]
    evaluations = training.to_dict()["evaluations"]
    played = [(evaluation["steps"], evaluation["mean_reward"]) for evaluation in evaluations]
    assert told.of("evaluation/mean_reward") == played
    assert len(played) == 2
    steps = [steps for _, steps in told]
    assert steps == sorted(steps)


def test_a_training_with_a_callback_is_the_one_without() -> None:
    policies = [
        qcompile.train("CartPole-v1", **PAPER, seed=4, callback=callback).policy
        for callback in (None, Told())
    ]
    assert policies[0] is not None
    assert policies[1] is not None
    np.testing.assert_array_equal(policies[0].weights, policies[1].weights)


@pytest.mark.parametrize("no", [False, np.False_])
def test_false_ends_the_training_after_the_update(no: object) -> None:
    told = Told(None, None, True, 0, no)  # two calls an episode: the third episode's first
    training = qcompile.train("CartPole-v1", **PAPER, callback=told, out="p.pt")
    training.check_complete()
    assert (training.stopped, training.interrupted) == (True, False)
    assert len(training.episodes) == 3
    assert len(told) == 6
    assert training.table().words[0][-1] == "stopped"
    short = qcompile.train("CartPole-v1", preset="paper", episodes=3).policy
    assert short is not None
    np.testing.assert_array_equal(qcompile.load_policy("p.pt").weights, short.weights)


def test_what_a_callback_raises_is_its_own_and_what_was_learned_is_kept() -> None:
    class MineError(Exception):
        pass

    error = MineError("no more")

    def fails(scalars: Any, steps: int) -> None:
        told(scalars, steps)
        if len(told) == 5:  # the reward of the third episode
            raise error

    told = Told()
    files = {"out": "p.pt", "checkpoint": "state", "log": "log.csv"}
    with pytest.raises(MineError) as caught:
        qcompile.train("CartPole-v1", **PAPER, callback=fails, **files)
    assert caught.value is error
    assert error.__notes__ == ["The policy trained so far is in p.pt."]
    assert len(told) == 5  # it is not called again
    assert len(Path("log.csv").read_text().splitlines()) == 1 + 3
    two = qcompile.train("CartPole-v1", preset="paper", episodes=2).policy
    assert two is not None
    np.testing.assert_array_equal(qcompile.load_policy("p.pt").weights, two.weights)
    whole = qcompile.train("CartPole-v1", **PAPER)
    assert qcompile.train("CartPole-v1", resume="state").rewards == whole.rewards


@pytest.mark.parametrize(
    ("out", "note"),
    [
        (None, "Nothing was learned yet."),
        ("p.pt", "Nothing was learned yet, so p.pt was not written."),
    ],
)
def test_nothing_is_written_where_nothing_was_learned(out: Any, note: str) -> None:
    def fails(scalars: Any, steps: int) -> None:
        raise QcompileError("at once")

    with pytest.raises(QcompileError, match="at once") as caught:
        qcompile.train("CartPole-v1", **PAPER, callback=fails, out=out)
    assert caught.value.__notes__ == [note]
    assert list(Path().iterdir()) == []


def test_a_callback_is_a_function() -> None:
    with pytest.raises(OptionError) as caught:
        qcompile.train("CartPole-v1", callback="wandb")  # type: ignore[arg-type]
    assert str(caught.value) == (
        "callback cannot be 'wandb'.\n  It must be a function of scalars and steps or None."
    )


def run_block(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Run the block of the documentation that imports this module, and give its stand-in."""
    (text,) = (block for block in BLOCKS if f"import {name}\n" in block)
    module = trackers()[name]
    monkeypatch.setitem(sys.modules, name, module)
    exec(compile(text, "docs/howto/callbacks.md", "exec"), {"__name__": "__main__"})
    return module


def test_weights_and_biases_gets_a_row_for_each_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    (run,) = run_block("wandb", monkeypatch).runs
    assert run.finished
    assert dict(run.config) == {"clip": 0.2}
    rewards = {step: row["rollout/episode_reward"] for step, row in run.rows.items()}
    assert len(rewards) == 20
    # CartPole pays 1 a step, in one environment.
    assert list(rewards.values()) == np.diff([0, *rewards]).tolist()
    assert all("update/entropy" in row for row in run.rows.values())


def test_mlflow_gets_every_scalar(monkeypatch: pytest.MonkeyPatch) -> None:
    mlflow = run_block("mlflow", monkeypatch)
    assert (mlflow.active, mlflow.params) == (False, {"clip": 0.2})
    names = [name for name, _, _ in mlflow.metrics]
    assert {names.count(name) for name in ("rollout/average_20", "update/actor_loss")} == {20}


def test_optuna_prunes_and_finds_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    (study,) = run_block("optuna", monkeypatch).studies
    assert study.direction == "maximize"
    states = ["COMPLETE", "COMPLETE", "PRUNED", "COMPLETE"]
    assert [trial.state for trial in study.trials] == states
    # 20 episodes with an evaluation after every five
    assert [len(trial.reported) for trial in study.trials] == [4, 4, 1, 4]
    for trial in study.trials:
        last = [*trial.reported.values()][-1]
        assert trial.value == (None if trial.state == "PRUNED" else last)
