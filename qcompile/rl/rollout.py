"""Collects experience from environments that step together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import BoolArray, FloatArray, IntArray
from qcompile.deploy.environments import (
    close_environments,
    features_and_actions,
)
from qcompile.deploy.stepping import Stepper, check_finite
from qcompile.errors import TrainingError
from qcompile.rl.environments import training_environments


@dataclass(frozen=True)
class FinishedEpisode:
    """An episode of training: its number from 1 and its reward.

    `steps` and `decisions` count all environment steps and decisions taken by its end; they are
    equal if decisions are not held.
    """

    episode: int
    steps: int
    reward: float
    decisions: int


@dataclass(frozen=True, eq=False)
class Rollout:
    """Decisions in n environments: arrays (decisions, n), observations (decisions, n, features).

    Rewards are sums over the steps that a decision is held for. `next_observations` are the
    observations after the actions, before any reset.
    """

    observations: NDArray[np.floating]
    actions: IntArray
    rewards: FloatArray
    next_observations: NDArray[np.floating]
    terminated: BoolArray
    truncated: BoolArray
    finished: list[FinishedEpisode]

    @property
    def done(self) -> BoolArray:
        return self.terminated | self.truncated


class Collector:
    """Steps `count` environments together, and resets each when its episode ends.

    Observations have the type `dtype`: float32, or float64 if the declared type needs it. A
    decision is held for `hold` steps; `steps` counts every step taken, `decisions` every decision,
    and `history` has every finished episode. Every episode has its own seed, so an environment's
    state can be rebuilt by replaying its actions.
    """

    def __init__(
        self,
        name: str,
        count: int,
        seeds: np.random.SeedSequence,
        arguments: Mapping[str, Any] | None = None,
        bits: bool = False,
        hold: int = 1,
    ):
        environments = training_environments(name, count, bits, arguments)
        self.features, self.actions = features_and_actions(environments[0])
        self._rng = np.random.default_rng(seeds)
        self._steppers = [Stepper(environment, hold) for environment in environments]
        self._taken: list[list[int]] = [[] for _ in environments]
        """The actions of each environment's current episode."""
        first = [stepper.reset(self._seed()) for stepper in self._steppers]
        self._observations: NDArray[np.floating] = np.stack(first)
        self.dtype = self._observations.dtype
        self.steps = self.decisions = 0
        self.history: list[FinishedEpisode] = []

    @property
    def observations(self) -> NDArray[np.floating]:
        """The current observations, (environments, features)."""
        return self._observations

    def _seed(self) -> int:
        return int(self._rng.integers(2**31))

    def collect(
        self, act: Callable[[NDArray[np.floating]], IntArray], horizon: int | None
    ) -> Rollout:
        """Collect `horizon` decisions in every environment, or one whole episode of each.

        `act` maps observations (n, features) to actions (n,).

        Raises:
            EnvironmentStepError: an environment fails, or gives what no policy can use.
        """
        columns: tuple[list[NDArray[Any]], ...] = ([], [], [], [], [], [])
        before = len(self.history)
        count = len(self._steppers)
        while len(columns[0]) != horizon:
            actions = act(self._observations)
            following = np.empty_like(self._observations)
            after = np.empty_like(self._observations)
            rewards, flags = np.empty(count), np.zeros((2, count), dtype=bool)
            over: list[tuple[int, int]] = []
            steps = self.steps
            for i, (stepper, action) in enumerate(
                zip(self._steppers, actions.tolist(), strict=True)
            ):
                steps -= stepper.length
                observation, rewards[i], terminated, truncated = stepper.step(action)
                steps += stepper.length
                following[i] = after[i] = observation
                self._taken[i].append(action)
                if terminated or truncated:
                    flags[:, i] = terminated, truncated
                    over.append((i, steps))
            check_finite(self._steppers, following)
            for i, end in over:
                number, decisions = len(self.history) + 1, self.decisions + i + 1
                reward = self._steppers[i].reward
                self.history.append(FinishedEpisode(number, end, reward, decisions))
                after[i] = self._steppers[i].reset(self._seed())
                self._taken[i].clear()
            row = (self._observations, actions, rewards, following, *flags)
            for column, values in zip(columns, row, strict=True):
                column.append(values)
            self._observations = after
            self.steps, self.decisions = steps, self.decisions + count
            if horizon is None and len(self.history) > before:
                break
        observations, taken, rewarded, successors, terminals, cuts = map(np.stack, columns)
        finished = self.history[before:]
        return Rollout(observations, taken, rewarded, successors, terminals, cuts, finished)

    def state(self) -> dict[str, Any]:
        """Plain values for `restore`, between two rollouts."""
        return {
            "rng": self._rng.bit_generator.state,
            "steps": self.steps,
            "decisions": self.decisions,
            "episodes": [[e.steps, e.reward, e.decisions] for e in self.history],
            "walks": [
                [stepper.seed, list(taken)]
                for stepper, taken in zip(self._steppers, self._taken, strict=True)
            ],
            "observations": self._observations.tolist(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from `state`: every environment replays the actions of its episode.

        Raises:
            TrainingError: an environment does not return to its state.
        """
        self._rng.bit_generator.state = state["rng"]
        self.steps, self.decisions = int(state["steps"]), int(state["decisions"])
        self.history = [
            FinishedEpisode(number, int(steps), float(reward), int(decisions))
            for number, (steps, reward, decisions) in enumerate(state["episodes"], 1)
        ]
        for i, (stepper, (seed, actions)) in enumerate(
            zip(self._steppers, state["walks"], strict=True)
        ):
            observation = stepper.reset(seed)
            for action in actions:
                observation, _, terminated, truncated = stepper.step(action)
                if terminated or truncated:
                    raise TrainingError("An episode in the checkpoint ends before its last action.")
            self._taken[i] = list(actions)
            self._observations[i] = observation
        saved = np.array(state["observations"], dtype=self.dtype)
        if not np.array_equal(self._observations, saved):
            raise TrainingError(
                "The environments do not return to their state in the checkpoint.",
                "Resume it with the versions that wrote it.",
            )

    def close(self) -> None:
        close_environments(stepper.environment for stepper in self._steppers)
