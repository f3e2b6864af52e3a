"""Play episodes with a policy on a backend, all in lockstep."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Protocol

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.environments import (
    Environment,
    check_fit,
    close_environments,
    make_environments,
    reward_threshold,
)
from qcompile.deploy.lockstep import Act, Episode, Frame, lockstep
from qcompile.deploy.result import RunResult
from qcompile.errors import CountsError
from qcompile.limits import MAX_EPISODES


class Record(Protocol):
    """Keeps the steps of a run."""

    def act(self, act: Act, observations: FloatArray) -> IntArray:
        """The actions (B,) for observations (B, features), which `act` may be asked for."""
        ...

    def rewards(self, rewards: list[float]) -> None:
        """What the episodes of the last step earned by its actions."""
        ...


def _drop(rewards: list[float]) -> None:
    """Nobody records them."""


def play(
    deployment: Deployment,
    episodes: int,
    *,
    max_steps: int | None = None,
    record: Record | None = None,
    on_episode: Callable[[Episode], None] = lambda episode: None,
    on_frame: Callable[[Frame, float], None] | None = None,
) -> RunResult:
    """Play `episodes` episodes in lockstep; episode i resets with the deployment's seed + i.

    All living episodes step together: one batch of circuits, one job. An episode ends after
    `max_steps`. Ctrl-C ends the run and keeps what is finished; `record` sees every step.
    `on_frame` gets the frames of the first episode, (height, width, 3), and how many of them make a
    second.

    Raises:
        CountsError: episodes lie outside [1, MAX_EPISODES].
        EnvironmentMismatchError: the environment is unknown or does not fit the policy.
        EnvironmentStepError: it fails in an episode, or gives what no policy can use.
    """
    if not 1 <= episodes <= MAX_EPISODES:
        raise CountsError(
            f"{episodes} episodes cannot be played.", f"Their number lies in [1, {MAX_EPISODES}]."
        )
    name, arguments = deployment.policy.environment, deployment.policy.environment_kwargs
    environments = make_environments(name, 1, film=on_frame is not None, arguments=arguments)
    try:
        check_fit(deployment.policy, environments[0])
        environments += make_environments(name, episodes - 1, arguments=arguments)
        return _play(deployment, environments, max_steps, record, on_episode, on_frame)
    finally:
        close_environments(environments)


def _play(
    deployment: Deployment,
    environments: list[Environment],
    max_steps: int | None,
    record: Record | None,
    on_episode: Callable[[Episode], None],
    on_frame: Callable[[Frame, float], None] | None,
) -> RunResult:
    result = RunResult(deployment, reward_threshold(environments[0]), max_steps)

    def note(episode: Episode) -> None:
        result.episodes.append(episode)
        on_episode(episode)

    started = time.perf_counter()
    try:
        lockstep(
            deployment.act if record is None else partial(record.act, deployment.act),
            environments,
            deployment.seed,
            max_steps=max_steps,
            on_step=result.count_step,
            on_rewards=_drop if record is None else record.rewards,
            on_episode=note,
            on_frame=on_frame,
        )
    except KeyboardInterrupt:
        result.interrupted = True
    result.wall_seconds = time.perf_counter() - started
    result.episodes.sort(key=lambda episode: episode.seed)
    return result
