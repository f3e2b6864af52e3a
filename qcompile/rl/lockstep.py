"""Play episodes side by side: every step serves all that still live."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qcompile.rl.environments import Environment, frames_per_second, reset_all

Act = Callable[[NDArray[np.float64]], NDArray[np.intp]]
Frame = NDArray[np.uint8]


@dataclass(frozen=True)
class Episode:
    """One finished episode: the seed of its reset, its total reward, its number of steps."""

    seed: int
    reward: float
    length: int


@dataclass(slots=True)
class _Living:
    """An episode that goes on."""

    environment: Environment
    seed: int
    reward: float = 0.0


def lockstep(
    act: Act,
    environments: list[Environment],
    first_seed: int,
    *,
    max_steps: int | None = None,
    on_step: Callable[[int], None] = lambda living: None,
    on_rewards: Callable[[list[float]], None] = lambda rewards: None,
    on_episode: Callable[[Episode], None] = lambda episode: None,
    on_frame: Callable[[Frame, float], None] | None = None,
) -> None:
    """Play one episode in every environment, the i-th reset with `first_seed` + i.

    `act` maps the observations (B, features) of the living episodes to actions (B,). `on_step` gets
    their number with each step, `on_rewards` what they earned by it; `on_frame` the frames of the
    first episode, (height, width, 3), and how many of them make a second. After `max_steps` an
    episode ends, whatever the environment says.
    """
    seeds = [first_seed + i for i in range(len(environments))]
    living = [_Living(*pair) for pair in zip(environments, seeds, strict=True)]
    filmed = living[0] if on_frame is not None else None
    fps = frames_per_second(environments[0])
    observations = reset_all(environments, seeds)
    length = 0
    while living:
        actions = act(observations).tolist()
        on_step(len(living))
        length += 1
        going: list[_Living] = []
        rewards: list[float] = []
        for episode, action in zip(living, actions, strict=True):
            seen, reward, terminated, truncated, _ = episode.environment.step(action)
            rewards.append(float(reward))
            episode.reward += rewards[-1]
            if episode is filmed and on_frame is not None:
                on_frame(episode.environment.render(), fps)  # type: ignore[arg-type]
            if terminated or truncated or length == max_steps:
                on_episode(Episode(episode.seed, episode.reward, length))
            else:  # those that go on move up; the rows they take have been used
                observations[len(going)] = seen
                going.append(episode)
        living, observations = going, observations[: len(going)]
        on_rewards(rewards)
