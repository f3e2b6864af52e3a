"""The score of a model: rewards of the right episodes, without disturbing the training."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from qcompile.rl.ppo import Trainer
from qcompile.rl.score import score
from qcompile.rl.settings import Settings

MODELS: dict[str, dict[str, Any]] = {
    "svqc": {},
    "svqc with noise": {"backend": "ibm_lima", "shots": 64, "mitigation": "readout"},
    "surrogate": {"model": "surrogate"},
    "fcn": {"model": "fcn", "hidden": (4,)},
    "mvqc": {"model": "mvqc"},
}


def always_left(seed: int) -> float:
    """The reward of a CartPole episode in which every action is 0."""
    environment = gymnasium.make("CartPole-v1")
    environment.reset(seed=seed)
    total, ended = 0.0, False
    while not ended:
        _, reward, terminated, truncated, _ = environment.step(0)
        total, ended = total + float(reward), terminated or truncated
    environment.close()
    return total


@pytest.mark.parametrize("model", MODELS)
def test_rewards_are_those_of_the_seeds_in_their_order(model: str) -> None:
    trainer = Trainer("CartPole-v1", Settings(episodes=1, **MODELS[model]), 0)
    with torch.no_grad():  # the last bias: action 0 whatever is seen
        list(trainer.actor.parameters())[-1].copy_(torch.tensor([1000.0, 0.0]))
    expected = [always_left(seed) for seed in range(70, 76)]
    assert len(set(expected)) > 1
    np.testing.assert_array_equal(score(trainer, 6, 70), expected)


@pytest.mark.parametrize("model", MODELS)
def test_a_training_does_not_notice(model: str) -> None:
    settings = Settings(episodes=4, **MODELS[model])
    alone, scored = (Trainer("CartPole-v1", settings, 0) for _ in range(2))
    seen: list[np.ndarray[Any, Any]] = []
    scored.train(on_update=lambda: seen.append(score(scored, 3, 9)))
    alone.train()
    assert scored.history == alone.history
    for one, other in zip(scored.actor.parameters(), alone.actor.parameters(), strict=True):
        assert torch.equal(one, other)
    np.testing.assert_array_equal(score(scored, 3, 9), seen[-1])


@pytest.mark.parametrize("model", ["svqc", "fcn"])
def test_ctrl_c_is_passed_on(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    trainer = Trainer("CartPole-v1", Settings(episodes=1, **MODELS[model]), 0)

    def step(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(gymnasium.wrappers.TimeLimit, "step", step)
    with pytest.raises(KeyboardInterrupt):
        score(trainer, 2, 0)
