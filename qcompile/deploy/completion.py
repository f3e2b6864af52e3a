"""Rewards of cut episodes, completed on a simulation at no cost."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.lockstep import proceed
from qcompile.deploy.player import Player
from qcompile.deploy.stepping import Stepper
from qcompile.errors import QcompileError
from qcompile.execution import OfflineExecutor, TwinExecutor

MOST_STEPS = 10_000
"""The most environment steps of a completion; some environments never end an episode."""


def completed_rewards(player: Player, steppers: Sequence[Stepper]) -> FloatArray | None:
    """Rewards (episodes,) of the episodes of `player`, with those cut by `max_steps` completed.

    They continue from the cut with their own streams: on a noise model, a twin or `ideal` as if
    they had not been cut, otherwise on the device's noise model with the same settings. None if no
    episode was cut, if one does not end within MOST_STEPS or its environment fails, or after
    Ctrl-C.
    """
    cut = [stepper for stepper in steppers if stepper.is_cut]
    if not cut:
        return None
    with suppress(KeyboardInterrupt, QcompileError):
        length = cut[0].length
        for stepper in cut:
            stepper.lengthen(length + MOST_STEPS)
        living = [stepper for stepper in cut if not stepper.is_over]
        if living:
            numbers = np.array([stepper.seed for stepper in living]) - player.settings.seed
            observations = np.stack([stepper.observation for stepper in living])
            decided = -(-length // player.policy.hold)
            proceed(_free(player).act, living, numbers, observations, decided)
        if all(stepper.is_over for stepper in cut):
            return np.array([stepper.reward for stepper in steppers])
    return None


def _free(player: Player) -> Player:
    """The player itself if it costs nothing, else one on the noise model of its device."""
    if not isinstance(player, Deployment):
        return player
    if isinstance(player.executor, OfflineExecutor | TwinExecutor):
        return player
    return Deployment(player.policy, player.device, player.settings)
