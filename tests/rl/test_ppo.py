"""Training: trivial tasks are learned, runs repeat, and presets match the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from qcompile.errors import EnvironmentMismatchError, TrainingError
from qcompile.policy import Network, Policy
from qcompile.rl.ppo import Trainer
from qcompile.rl.presets import settings_for
from qcompile.rl.result import TrainingResult
from qcompile.rl.rollout import FinishedEpisode
from qcompile.rl.settings import Settings

Outputs = Callable[[Policy, np.ndarray], np.ndarray]

QUICK = Settings(
    environments=4,
    horizon=64,
    steps=8000,
    actor_lr=0.05,
    critic_lr=0.05,
    theta_spread_rad=1.0,
    weight_spread=0.01,
    minibatch=64,
    clip=0.2,
)


def numbers(result: TrainingResult) -> list[bytes]:
    policy = result.policy
    arrays = (policy.theta, policy.weights, policy.bias, policy.encoder.scale)
    return [array.tobytes() for array in arrays]


@pytest.mark.parametrize("seed", [0, 1])
def test_a_trivial_task_is_learned(seed: int, outputs: Outputs) -> None:
    """20 steps that pay 1 for the named action: chance is 10 of 20, nine in ten are asked for."""
    result = Trainer("Match-v0", QUICK, seed).train()
    logits = outputs(result.policy, np.array([[-1.0], [1.0]]))
    odds = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    assert odds[0, 0] > 0.9
    assert odds[1, 1] > 0.9
    rewards = [episode.reward for episode in result.episodes]
    assert np.mean(rewards[:10]) < 15
    assert np.mean(rewards[-10:]) > 18


def test_the_same_seed_trains_the_same_policy() -> None:
    settings = replace(QUICK, steps=800, trainable_scale=True, scales=(1.0, 3.0), entropy=0.01)
    first, again, other = (Trainer("Match-v0", settings, seed).train() for seed in (3, 3, 4))
    assert numbers(first) == numbers(again)
    assert first.episodes == again.episodes
    assert numbers(first) != numbers(other)


def test_a_budget_of_steps_or_episodes_is_kept() -> None:
    by_steps = Trainer("Match-v0", replace(QUICK, steps=513), 0).train()
    assert by_steps.steps == 768, "whole rollouts of 4 * 64 steps"
    paper = replace(settings_for("paper", "Match-v0"), episodes=3)
    by_episodes = Trainer("Match-v0", paper, 0).train()
    assert [e.episode for e in by_episodes.episodes] == [1, 2, 3]
    assert [e.steps for e in by_episodes.episodes] == [20, 40, 60]
    both = Trainer("Match-v0", replace(paper, steps=21), 0).train()
    assert len(both.episodes) == 2, "the first budget spent ends the run"


def test_cartpole_improves_clearly_over_chance() -> None:
    """Random play lasts 22 steps (deviation 12): a mean of 20 episodes above 100 is not chance."""
    settings = replace(settings_for("tuned", "CartPole-v1"), steps=30_000)
    result = Trainer("CartPole-v1", settings, 0).train()
    rewards = [episode.reward for episode in result.episodes]
    assert np.mean(rewards[:5]) < 60
    assert np.mean(rewards[-20:]) > 100
    assert result.policy.environment == "CartPole-v1"
    assert result.policy.name == "trained-cartpole"
    assert result.policy.metadata["steps"] == result.steps


def test_the_paper_preset_runs() -> None:
    settings = replace(settings_for("paper", "CartPole-v1"), episodes=8)
    result = Trainer("CartPole-v1", settings, 0).train()
    assert len(result.episodes) == 8
    assert not result.interrupted
    assert result.policy.parameter_count == 4 + 8 + 2
    assert result.policy.reuse == 1
    assert result.policy.theta.any(), "theta starts at 0 and is trained"


@pytest.mark.parametrize(
    ("environment", "layout", "actor_lr", "critic_lr", "gamma", "reuse", "circuits", "pause_at"),
    [
        ("CartPole-v1", "parallel", 0.001, 0.01, 0.99, 16, 1, None),
        ("CartPole-v1", "single", 0.004, 0.04, 0.99, 1, 1, None),
        ("Acrobot-v1", "parallel", 0.004, 0.04, 0.98, 8, 1, None),
        ("LunarLander-v3", "parallel", 0.002, 0.02, 0.98, 8, 3, 200.0),
    ],
)
def test_the_paper_preset_is_the_paper_s_table(
    environment: str,
    layout: str,
    actor_lr: float,
    critic_lr: float,
    gamma: float,
    reuse: int,
    circuits: int,
    pause_at: float | None,
) -> None:
    settings = settings_for("paper", environment, "svqc", layout)
    assert (settings.actor_lr, settings.critic_lr) == (actor_lr, critic_lr)
    assert (settings.gamma, settings.epochs, settings.clip) == (gamma, 4, 0.1)
    assert (settings.reuse, settings.scales) == (reuse, (1.0,) * circuits)
    assert settings.pause_at == pause_at
    # Algorithm 1: a whole episode at a time, discounted returns, nothing else
    assert (settings.environments, settings.horizon, settings.minibatch) == (1, None, None)
    assert (settings.gae_lambda, settings.entropy, settings.gradient_norm) == (1.0, 0.0, None)
    extras = (settings.anneal, settings.scale_rewards, settings.bootstrap_truncated)
    assert extras == (False, False, False)
    assert (settings.theta_spread_rad, settings.trainable_scale) == (0.0, False)


def test_a_critic_can_be_a_network_beside_circuits() -> None:
    """Weights and biases: 4 to 8, 8 to 6, 6 to 1; tanh between; the policy is circuits still."""
    settings = settings_for("paper", "CartPole-v1").changed(critic_hidden=(8, 6), episodes=3)
    trainer = Trainer("CartPole-v1", settings, 0)
    first = [p.detach().clone() for p in trainer._critic.parameters()]
    assert [tuple(p.shape) for p in first] == [(8, 4), (8,), (6, 8), (6,), (1, 6), (1,)]
    assert first[4].abs().max() < 0.06, "first values are near 0: a deviation of 0.01"
    assert (first[5] == 0).all()
    seen = torch.randn(7, 4, generator=torch.Generator().manual_seed(0))
    value = seen.numpy()
    for weight, bias in ((first[0], first[1]), (first[2], first[3])):
        value = np.tanh(value @ weight.numpy().T + bias.numpy())
    value = value @ first[4].numpy().T + first[5].numpy()
    np.testing.assert_allclose(trainer._critic(seen).detach().numpy(), value, rtol=1e-5, atol=1e-6)
    result = trainer.train()
    assert all((p != q).any() for p, q in zip(first, trainer._critic.parameters(), strict=True))
    assert result.policy.parameter_count == 4 + 2 * 4 + 2


def test_input_scales_that_are_not_trained_stay() -> None:
    settings = QUICK.changed(steps=512, scales=(0.7, 2.0))
    trained = Trainer("Match-v0", settings, 0).train()
    np.testing.assert_allclose(trained.policy.encoder.scale, [0.7, 2.0], rtol=1e-6)
    moved = Trainer("Match-v0", settings.changed(trainable_scale=True), 0).train()
    assert (np.abs(moved.policy.encoder.scale - [0.7, 2.0]) > 1e-3).all()


@pytest.mark.parametrize("model", ["svqc", "mvqc", "surrogate", "fcn", "cnn"])
def test_every_model_learns_a_trivial_task(model: str, outputs: Outputs) -> None:
    """As above, by playing."""
    changes: dict[str, Any] = {} if model in ("svqc", "mvqc") else {"theta_spread_rad": 0.0}
    changes |= {"hidden": (8,)} if model in ("fcn", "cnn") else {}
    result = Trainer("Match-v0", QUICK.changed(model=model, **changes, actor_lr=0.03), 0).train()
    rewards = [episode.reward for episode in result.episodes]
    assert np.mean(rewards[:10]) < 15
    assert np.mean(rewards[-10:]) > 18
    ends = np.array([[-1.0], [1.0]])
    is_network = isinstance(result.policy, Network)
    logits = result.policy.logits(ends) if is_network else outputs(result.policy, ends)
    assert logits.argmax(axis=1).tolist() == [0, 1]


def test_ctrl_c_keeps_what_was_learned() -> None:
    seen: list[FinishedEpisode] = []

    def note(episode: FinishedEpisode, progress: float) -> None:
        assert 0 < progress <= 1
        seen.append(episode)
        if len(seen) == 3:
            raise KeyboardInterrupt

    threads = torch.get_num_threads()
    settings = replace(settings_for("paper", "Match-v0"), episodes=100)
    result = Trainer("Match-v0", settings, 0).train(note)
    assert result.interrupted
    assert result.episodes == seen
    assert len(seen) == 3
    whole = Trainer("Match-v0", replace(settings, episodes=2), 0).train()
    assert numbers(result) == numbers(whole), "two episodes were learned from, the third was not"
    assert torch.get_num_threads() == threads


def test_a_trainer_checks_what_it_is_given() -> None:
    with pytest.raises(TrainingError, match="4 environments need a horizon"):
        Trainer("Match-v0", Settings(environments=4, steps=1), 0)
    with pytest.raises(EnvironmentMismatchError, match="Unknown environment 'CartPoll-v1'"):
        Trainer("CartPoll-v1", QUICK, 0)


def test_a_shorter_training_is_the_start_of_the_longer_one() -> None:
    """Step sizes fall by the budget of the preset: fewer episodes change nothing before."""
    preset = settings_for("tuned", "CartPole-v1").changed(episodes=9, anneal_episodes=9)
    long, short = (
        Trainer("CartPole-v1", preset.changed(episodes=episodes), 5).train() for episodes in (9, 4)
    )
    assert short.episodes == long.episodes[:4]
    assert len(long.episodes) == 9
