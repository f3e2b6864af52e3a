"""Scores a model in training on new episodes."""

from __future__ import annotations

import numpy as np
import torch

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.environments import close_environments, make_environments
from qcompile.deploy.lockstep import Act, Episode, lockstep
from qcompile.deploy.play import play, player
from qcompile.deploy.rows import Rows
from qcompile.device import load_device
from qcompile.rl.draw import draw_actions
from qcompile.rl.ppo import Trainer


def score(trainer: Trainer, episodes: int, first_seed: int) -> FloatArray:
    """Rewards (episodes,) of the current model, with episode i reset by `first_seed` + i.

    Actions are sampled. A model that makes a policy plays as that policy, with circuits on the
    training's backend. All draws come from a generator derived from `first_seed`: the training is
    not disturbed, and the score is repeatable.
    """
    policy, settings = trainer.policy(), trainer.settings
    if policy is not None:
        model_player = player(
            policy,
            load_device(settings.backend),
            shots=settings.shots,
            mitigation=settings.mitigation,
            seed=first_seed,
        )
        result = play(model_player, episodes)
        if result.interrupted:
            raise KeyboardInterrupt
        return result.rewards
    rewards: dict[int, float] = {}

    def note(episode: Episode) -> None:
        rewards[episode.seed] = episode.reward

    environments = make_environments(trainer.environment, episodes, arguments=trainer.arguments)
    try:
        act = _sampling(trainer, first_seed)
        lockstep(act, environments, first_seed, hold=settings.hold, on_episode=note)
    finally:
        close_environments(environments)
    return np.array([rewards[seed] for seed in sorted(rewards)])


def _sampling(trainer: Trainer, seed: int) -> Act:
    """Actions drawn from the softmax of the model's outputs for normalised observations."""
    rng = np.random.default_rng(seed)
    mean, std = (0.0, 1.0) if trainer.normaliser is None else trainer.normaliser.statistics

    def act(observations: FloatArray, rows: Rows) -> IntArray:
        with torch.no_grad():
            inputs = (observations.astype(trainer.observation_dtype) - mean) / std
            logits = trainer.model(torch.from_numpy(inputs)).numpy()
        return draw_actions(logits, rng)

    return act
