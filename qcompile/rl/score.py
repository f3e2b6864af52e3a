"""Scores a model in training on new episodes."""

from __future__ import annotations

from qcompile.arrays import FloatArray
from qcompile.deploy.play import play, player
from qcompile.device import load_device
from qcompile.rl.ppo import Trainer


def score(trainer: Trainer, episodes: int, first_seed: int) -> FloatArray:
    """Rewards (episodes,) of the current model, with episode i reset by `first_seed` + i.

    It plays as its policy, with circuits on the training's backend, and samples actions. All draws
    come from a generator derived from `first_seed`: the training is not disturbed, and the score is
    repeatable.
    """
    settings = trainer.settings
    model_player = player(
        trainer.policy(),
        load_device(settings.backend),
        shots=settings.shots,
        mitigation=settings.mitigation,
        seed=first_seed,
    )
    result = play(model_player, episodes)
    if result.interrupted:
        raise KeyboardInterrupt
    return result.rewards
