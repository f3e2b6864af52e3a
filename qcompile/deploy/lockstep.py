"""Plays episodes in lockstep: each decision covers all running episodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.environments import Environment
from qcompile.deploy.rows import Rows
from qcompile.deploy.stepping import Stepper, check_finite

Act = Callable[[FloatArray, Rows], IntArray]


@dataclass(frozen=True)
class Episode:
    """One finished episode: the seed of its reset, its total reward, its number of steps."""

    seed: int
    reward: float
    length: int

    @classmethod
    def of(cls, stepper: Stepper) -> Episode:
        """The finished episode of a stepper."""
        return cls(stepper.seed, stepper.reward, stepper.length)


def lockstep(
    act: Act,
    environments: list[Environment],
    first_seed: int,
    *,
    hold: int = 1,
    episodes: Sequence[int] | None = None,
    max_steps: int | None = None,
    on_begin: Callable[[Sequence[Stepper]], None] = lambda steppers: None,
    on_rewards: Callable[[list[float]], None] = lambda rewards: None,
    on_episode: Callable[[Episode], None] = lambda episode: None,
) -> None:
    """Play one episode in every environment, with the numbers `episodes`, by default 0, 1, ...

    Episode i resets with `first_seed` + i. `act` maps the observations (B, features) of the running
    episodes, and the episode and decision of each row, to actions (B,). `on_begin` gets all
    steppers; `on_rewards` the rewards of a decision, which is held for `hold` environment steps. An
    episode is stopped after `max_steps` environment steps.

    Raises:
        EnvironmentStepError: an environment fails or returns unusable values.
    """
    living = [Stepper(environment, hold, max_steps) for environment in environments]
    numbers = np.arange(len(living)) if episodes is None else np.array(episodes)
    first = [
        stepper.reset(first_seed + i) for i, stepper in zip(numbers.tolist(), living, strict=True)
    ]
    on_begin(living)
    proceed(act, living, numbers, np.stack(first), 0, on_rewards=on_rewards, on_episode=on_episode)


def proceed(
    act: Act,
    living: Sequence[Stepper],
    numbers: IntArray,
    observations: NDArray[Any],
    decision: int,
    *,
    on_rewards: Callable[[list[float]], None] = lambda rewards: None,
    on_episode: Callable[[Episode], None] = lambda episode: None,
) -> None:
    """Play the running episodes with these `numbers` from `decision` to their ends, as `lockstep`.

    `observations` (B, features) are the inputs of their next decisions.

    Raises:
        EnvironmentStepError: an environment fails or returns unusable values.
    """
    observations = observations.astype(np.float64)
    while living:
        rows = Rows(numbers, np.full(len(living), decision))
        actions = act(observations, rows).tolist()
        decision += 1
        following = np.empty_like(observations)
        over: list[int] = []
        rewards: list[float] = []
        for i, (stepper, action) in enumerate(zip(living, actions, strict=True)):
            following[i], reward, terminated, truncated = stepper.step(action)
            rewards.append(reward)
            if terminated or truncated or stepper.length == stepper.max_steps:
                over.append(i)
                on_episode(Episode.of(stepper))
        check_finite(living, following)
        if over:
            living = [stepper for i, stepper in enumerate(living) if i not in over]
            following, numbers = np.delete(following, over, axis=0), np.delete(numbers, over)
        observations = following
        on_rewards(rewards)
