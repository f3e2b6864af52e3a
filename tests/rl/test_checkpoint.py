"""Checkpoints: a training resumes bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from qcompile.errors import OutputError
from qcompile.policy.files import policy_values
from qcompile.rl.checkpoint import load_checkpoint, save_checkpoint
from qcompile.rl.ppo import Trainer
from qcompile.rl.presets import settings_for
from qcompile.rl.result import TrainingResult
from qcompile.rl.settings import Settings

SavedAt = Callable[..., None]

TUNED = settings_for("tuned", "CartPole-v1").changed(
    steps=1600,
    environments=4,
    horizon=64,
    minibatch=100,
    anneal=True,
    scale_rewards=True,
    entropy=0.01,
    gradient_norm=0.5,
    gae_lambda=0.95,
)

NETWORK = Settings(
    model="fcn", hidden=(8, 6), weight_spread=0.1, environments=3, horizon=40, steps=960, epochs=2
)

LIMA = TUNED.changed(backend="ibm_lima", shots=64, mitigation="readout", epochs=2)

RUNS: dict[str, tuple[str, Settings]] = {
    "paper": ("CartPole-v1", settings_for("paper", "CartPole-v1").changed(episodes=20)),
    "tuned": ("CartPole-v1", TUNED),
    "algorithm 2": (
        "Match-v0",
        Settings(episodes=40, actor_lr=0.05, critic_lr=0.05, pause_at=13.0),
    ),
    "lander": (
        "LunarLander-v3",
        settings_for("paper", "LunarLander-v3").changed(episodes=6),
    ),
    "fcn": ("CartPole-v1", NETWORK),
    "cnn": ("Acrobot-v1", NETWORK.changed(model="cnn", steps=480, entropy=0.01)),
    "mvqc": ("CartPole-v1", settings_for("paper", "CartPole-v1", "mvqc").changed(episodes=8)),
    "surrogate": ("CartPole-v1", TUNED.changed(model="surrogate", theta_spread_rad=0.0)),
    "ibm_lima": ("CartPole-v1", LIMA),
    "memory": ("CartPole-v1", LIMA.changed(rollouts=3)),
    "held": ("CartPole-v1", LIMA.changed(rollouts=2, hold=3, decision_cost=0.1, steps=5000)),
    "episodes in memory": ("Match-v0", Settings(episodes=20, rollouts=4)),
    "average": ("CartPole-v1", NETWORK.changed(average_share=0.3)),
}


def numbers(trainer: Trainer, result: TrainingResult) -> list[bytes]:
    models = (result.actor, trainer.actor, trainer._critic)
    return [t.numpy().tobytes() for model in models for t in model.state_dict().values()]


@pytest.mark.parametrize("name", RUNS)
def test_a_resumed_training_is_an_undisturbed_one_bit_for_bit(
    name: str, tmp_path: Path, saved_at: SavedAt
) -> None:
    environment, settings = RUNS[name]
    whole = Trainer(environment, settings, 3)
    first = numbers(whole, TrainingResult(whole.actor, None, [], 0, False))
    undisturbed = whole.train()
    path = tmp_path / "run.checkpoint"
    saved_at(3, environment, settings, path)
    trainer, differ = load_checkpoint(path)
    assert differ == []
    assert (trainer.environment, trainer.settings, trainer.seed) == (environment, settings, 3)
    assert 0 < trainer.progress < 1
    resumed = trainer.train()
    assert numbers(trainer, resumed) == numbers(whole, undisturbed) != first
    assert resumed.episodes == undisturbed.episodes
    assert (resumed.steps, resumed.interrupted) == (undisturbed.steps, False)
    if undisturbed.policy is None:
        assert resumed.policy is None
        return
    assert resumed.policy is not None
    assert policy_values(resumed.policy) == policy_values(undisturbed.policy)


def test_a_training_may_stop_more_than_once(tmp_path: Path) -> None:
    """After every update it is left, written and read again."""
    environment, settings = RUNS["algorithm 2"]
    whole = Trainer(environment, settings, 1)
    undisturbed = whole.train()
    path = tmp_path / "run.checkpoint"
    save_checkpoint(Trainer(environment, settings, 1), path)

    def stop() -> None:
        save_checkpoint(trainer, path)
        raise KeyboardInterrupt

    for _ in range(40):
        trainer, _ = load_checkpoint(path)
        trainer.train(on_update=stop)
    trainer, _ = load_checkpoint(path)
    assert trainer.progress == 1.0
    resumed = trainer.train()
    assert numbers(trainer, resumed) == numbers(whole, undisturbed)
    assert resumed.episodes == undisturbed.episodes


@pytest.mark.parametrize("name", ["algorithm 2", "tuned", "ibm_lima", "average", "memory"])
def test_ctrl_c_within_a_rollout_goes_on_from_the_last_update(name: str, tmp_path: Path) -> None:
    """The state taken at an update is not touched by what happens after it."""
    environment, settings = RUNS[name]
    whole = Trainer(environment, settings, 3)
    undisturbed = whole.train()
    trainer, path = Trainer(environment, settings, 3), tmp_path / "run.checkpoint"
    states: list[dict[str, Any]] = []

    def stop(episode: object, progress: float) -> None:
        if len(states) == 3:
            raise KeyboardInterrupt

    result = trainer.train(stop, on_update=lambda: states.append(trainer.state()))
    assert result.interrupted
    assert len(states) == 3
    save_checkpoint(trainer, path, states[1])
    again, _ = load_checkpoint(path)
    resumed = again.train()
    assert numbers(again, resumed) == numbers(whole, undisturbed)
    assert resumed.episodes == undisturbed.episodes


def test_the_optimiser_goes_on_with_its_moments(tmp_path: Path, saved_at: SavedAt) -> None:
    """A fresh Adam would take other steps: the resumed run differs from it, not from the whole."""
    path = tmp_path / "run.checkpoint"
    saved_at(3, *RUNS["fcn"], path)
    trainer, _ = load_checkpoint(path)
    moments = trainer.state()["optimiser"]["state"]
    assert len(moments) == 2
    # 2 epochs of one whole rollout each, 3 updates
    assert [int(state["step"]) for state in moments.values()] == [6, 6]
    assert all(state["exp_avg"].any() for state in moments.values())


def test_versions_that_differ_are_named(tmp_path: Path, saved_at: SavedAt) -> None:
    path = tmp_path / "run.checkpoint"
    saved_at(1, *RUNS["fcn"], path)
    saved = torch.load(path, weights_only=True)
    saved["versions"] |= {"torch": "1.0", "forgotten": "7"}
    torch.save(saved, path)
    _, differ = load_checkpoint(path)
    assert differ == [f"torch 1.0 then, {torch.__version__} now", "forgotten 7 then, none now"]


def test_a_checkpoint_replaces_the_last_one_or_says_why_not(
    tmp_path: Path, saved_at: SavedAt
) -> None:
    path = tmp_path / "run.checkpoint"
    saved_at(1, *RUNS["fcn"], path)
    one = load_checkpoint(path)[0].steps
    saved_at(2, *RUNS["fcn"], path)
    assert load_checkpoint(path)[0].steps == 2 * one
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.checkpoint"]
    with pytest.raises(OutputError):
        save_checkpoint(Trainer(*RUNS["fcn"], 0), path / "below a file")
