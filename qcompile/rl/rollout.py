"""Collect experience from environments that step together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.rl.environments import features_and_actions, make_environments, reset_all

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class FinishedEpisode:
    """An episode of training: its number from 1, all steps taken by its end, its reward."""

    episode: int
    steps: int
    reward: float


@dataclass(frozen=True, eq=False)
class Rollout:
    """Steps of n environments: arrays (steps, n), observations (steps, n, features).

    `next_observations` are those the actions led to, before any reset; no step of a reset is in it.
    """

    observations: NDArray[np.float32]
    actions: IntArray
    rewards: FloatArray
    next_observations: NDArray[np.float32]
    terminated: BoolArray
    truncated: BoolArray
    finished: list[FinishedEpisode]

    @property
    def done(self) -> BoolArray:
        return self.terminated | self.truncated


class Collector:
    """Steps `count` environments together and resets each one when its episode ends.

    `steps` counts every step taken, `history` has every finished episode.
    """

    def __init__(self, name: str, count: int, seeds: np.random.SeedSequence):
        self._environments = make_environments(name, count)
        self.features, self.actions = features_and_actions(self._environments[0])
        first = [int(s) for s in seeds.generate_state(count)]
        self._observations = reset_all(self._environments, first).astype(np.float32)
        self._rewards = np.zeros(count)
        self.steps = 0
        self.history: list[FinishedEpisode] = []

    def collect(
        self, act: Callable[[NDArray[np.float32]], IntArray], horizon: int | None
    ) -> Rollout:
        """`horizon` steps of every environment, or without a horizon one whole episode of each.

        `act` maps observations (n, features) to actions (n,).
        """
        columns: tuple[list[NDArray[Any]], ...] = ([], [], [], [], [], [])
        before = len(self.history)
        count = len(self._environments)
        while len(columns[0]) != horizon:
            actions = act(self._observations)
            following = np.empty_like(self._observations)
            after = np.empty_like(self._observations)
            rewards, flags = np.empty(count), np.zeros((2, count), dtype=bool)
            for i, action in enumerate(actions.tolist()):
                following[i], rewards[i], terminated, truncated, _ = self._environments[i].step(
                    action
                )
                flags[:, i] = terminated, truncated
                self._rewards[i] += rewards[i]
                after[i] = following[i]
                if terminated or truncated:
                    number, steps = len(self.history) + 1, self.steps + i + 1
                    self.history.append(FinishedEpisode(number, steps, float(self._rewards[i])))
                    self._rewards[i] = 0.0
                    after[i] = self._environments[i].reset()[0]
            row = (self._observations, actions, rewards, following, *flags)
            for column, values in zip(columns, row, strict=True):
                column.append(values)
            self._observations = after
            self.steps += count
            if horizon is None and len(self.history) > before:
                break
        seen, acted, rewarded, led_to, ended, cut = map(np.stack, columns)
        finished = self.history[before:]
        return Rollout(seen, acted, rewarded, led_to, ended, cut, finished)

    def close(self) -> None:
        for environment in self._environments:
            environment.close()
