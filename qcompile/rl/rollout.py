"""Collect experience from environments that step together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.errors import TrainingError
from qcompile.rl.environments import Environment, features_and_actions, make_environments

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


@dataclass(eq=False)
class _Walk:
    """The episode an environment is in: the seed of its reset, the actions since, their reward."""

    environment: Environment
    seed: int
    actions: list[int]
    reward: float = 0.0

    def begin(self, seed: int) -> Any:
        """Reset; the first observation."""
        self.seed, self.reward = seed, 0.0
        self.actions.clear()
        return self.environment.reset(seed=seed)[0]


class Collector:
    """Steps `count` environments together and resets each one when its episode ends.

    `steps` counts every step taken, `history` has every finished episode. Every episode has a seed
    of its own, so that an environment is rebuilt by playing its actions again.
    """

    def __init__(self, name: str, count: int, seeds: np.random.SeedSequence):
        environments = make_environments(name, count)
        self.features, self.actions = features_and_actions(environments[0])
        self._rng = np.random.default_rng(seeds)
        self._walks = [_Walk(environment, 0, []) for environment in environments]
        self._observations = np.stack([walk.begin(self._seed()) for walk in self._walks])
        self._observations = self._observations.astype(np.float32)
        self.steps = 0
        self.history: list[FinishedEpisode] = []

    def _seed(self) -> int:
        return int(self._rng.integers(2**31))

    def collect(
        self, act: Callable[[NDArray[np.float32]], IntArray], horizon: int | None
    ) -> Rollout:
        """`horizon` steps of every environment, or without a horizon one whole episode of each.

        `act` maps observations (n, features) to actions (n,).
        """
        columns: tuple[list[NDArray[Any]], ...] = ([], [], [], [], [], [])
        before = len(self.history)
        count = len(self._walks)
        while len(columns[0]) != horizon:
            actions = act(self._observations)
            following = np.empty_like(self._observations)
            after = np.empty_like(self._observations)
            rewards, flags = np.empty(count), np.zeros((2, count), dtype=bool)
            for i, (walk, action) in enumerate(zip(self._walks, actions.tolist(), strict=True)):
                seen, reward, terminated, truncated, _ = walk.environment.step(action)
                following[i] = after[i] = seen
                rewards[i] = reward
                walk.reward += float(reward)
                walk.actions.append(action)
                if terminated or truncated:
                    flags[:, i] = terminated, truncated
                    number, steps = len(self.history) + 1, self.steps + i + 1
                    self.history.append(FinishedEpisode(number, steps, walk.reward))
                    after[i] = walk.begin(self._seed())
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

    def state(self) -> dict[str, Any]:
        """Plain values from which `restore` goes on, between two rollouts."""
        return {
            "rng": self._rng.bit_generator.state,
            "steps": self.steps,
            "episodes": [[e.steps, e.reward] for e in self.history],
            "walks": [[walk.seed, list(walk.actions)] for walk in self._walks],
            "observations": self._observations.tolist(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from `state`: every environment plays the actions of its episode again.

        Raises:
            TrainingError: an environment does not come to where it was.
        """
        self._rng.bit_generator.state = state["rng"]
        self.steps = int(state["steps"])
        self.history = [
            FinishedEpisode(number, int(steps), float(reward))
            for number, (steps, reward) in enumerate(state["episodes"], 1)
        ]
        for i, (walk, (seed, actions)) in enumerate(zip(self._walks, state["walks"], strict=True)):
            seen = walk.begin(seed)
            for action in actions:
                seen, reward, terminated, truncated, _ = walk.environment.step(action)
                walk.reward += float(reward)
                if terminated or truncated:
                    raise TrainingError("An episode of the checkpoint ends before its last action.")
            walk.actions.extend(actions)
            self._observations[i] = seen
        if not np.array_equal(self._observations, np.float32(state["observations"])):
            raise TrainingError(
                "The environments do not come to where the checkpoint left them.",
                "Go on with the versions it was made with; it names them.",
            )

    def close(self) -> None:
        for walk in self._walks:
            walk.environment.close()
