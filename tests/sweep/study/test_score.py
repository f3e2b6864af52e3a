"""Scores taken while a model is trained: they repeat, and the training does not notice."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete

from qcompile.rl.ppo import Trainer
from qcompile.rl.score import score
from qcompile.rl.settings import Settings

SVQC = Settings(environments=2, horizon=16, steps=96, theta_spread_rad=1.0)
MODELS = {
    "svqc": SVQC,
    "svqc with noise": SVQC.changed(backend="ibm_lima", shots=16, mitigation="readout"),
    "surrogate": SVQC.changed(model="surrogate", theta_spread_rad=0.0),
    "mvqc": SVQC.changed(model="mvqc"),
    "fcn": SVQC.changed(model="fcn", hidden=(4,), theta_spread_rad=0.0),
    "whole episodes": Settings(episodes=4),
}


class Seeded(gymnasium.Env[Any, Any]):
    """Three steps, each of which pays the seed of the reset, and action / 8."""

    def __init__(self, render_mode: str | None = None):
        self.observation_space = Box(-np.inf, np.inf, (1,), np.float32)
        self.action_space = Discrete(2)
        self.render_mode = render_mode

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.seed, self.left = seed or 0, 3
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.left -= 1
        return np.zeros(1, np.float32), self.seed + action / 8, self.left == 0, False, {}


@pytest.fixture(autouse=True)
def seeded() -> Iterator[None]:
    gymnasium.register("Seeded-v0", Seeded, disable_env_checker=True)
    yield
    del gymnasium.registry["Seeded-v0"]


def trained(settings: Settings, on_update: Callable[[Trainer], None]) -> tuple[Any, ...]:
    """All that a training leaves: its episodes, its weights, and the state of its draws."""
    trainer = Trainer("CartPole-v1", settings, 5)
    result = trainer.train(on_update=lambda: on_update(trainer))
    weights = {name: value.tolist() for name, value in result.actor.state_dict().items()}
    generator, rng = trainer.state()["generator"].tolist(), trainer.state()["rng"]
    return result.episodes, weights, generator, rng, trainer.last_update


@pytest.mark.parametrize("name", MODELS)
def test_a_training_does_not_notice(name: str) -> None:
    scores: list[np.ndarray] = []
    alone = trained(MODELS[name], lambda trainer: None)
    watched = trained(MODELS[name], lambda trainer: scores.append(score(trainer, 3, 10_000)))
    assert watched == alone
    assert len(scores) >= 3
    assert all(rewards.shape == (3,) and rewards.min() >= 1 for rewards in scores)


@pytest.mark.parametrize("name", MODELS)
def test_a_score_repeats_and_draws_nothing_of_others(name: str) -> None:
    trainer = Trainer("CartPole-v1", MODELS[name], 0)
    kept = torch.get_rng_state(), np.random.get_state()[1].copy(), random.getstate()
    first, again, other = (score(trainer, 8, seed) for seed in (20, 20, 21))
    assert first.tolist() == again.tolist()
    assert first.tolist() != other.tolist()
    assert torch.equal(torch.get_rng_state(), kept[0])
    assert np.array_equal(np.random.get_state()[1], kept[1])
    assert random.getstate() == kept[2]


@pytest.mark.parametrize("name", MODELS)
def test_episode_i_has_the_first_seed_and_i(name: str) -> None:
    """Three steps pay 3 seeds and at most 3/8; 40 episodes without sampling would all be alike."""
    rewards = score(Trainer("Seeded-v0", MODELS[name], 0), 40, 70)
    extra = rewards - 3.0 * np.arange(70, 110)
    assert extra.min() >= 0
    assert extra.max() <= 3 / 8
    assert len(set(extra.tolist())) > 1, "actions are sampled"


@pytest.mark.parametrize("model", ["svqc", "fcn"])
def test_a_score_is_that_of_the_model_as_it_is(model: str) -> None:
    """A last layer that always says 1 is paid for it in every step."""
    trainer = Trainer("Seeded-v0", MODELS[model], 0)
    with torch.no_grad():
        for parameter in trainer.actor.parameters():
            if parameter.shape == (2,):
                parameter.copy_(torch.tensor([-50.0, 50.0]))
    assert score(trainer, 2, 0).tolist() == [3 / 8, 3 + 3 / 8]


def test_the_noise_of_the_backend_is_in_the_score() -> None:
    """On one backend with shots and on the other without, the same model is not played alike."""
    policies = [Trainer("CartPole-v1", MODELS[name], 0) for name in ("svqc", "svqc with noise")]
    first, second = (trainer.policy() for trainer in policies)
    assert first is not None
    assert second is not None
    assert first.weights.tolist() == second.weights.tolist()
    exact, noisy = (score(trainer, 20, 0) for trainer in policies)
    assert exact.tolist() != noisy.tolist()
