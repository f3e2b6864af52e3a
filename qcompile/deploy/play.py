"""Plays episodes of a policy on a backend, in lockstep."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.caller import option
from qcompile.deploy.ahead import Foresight, ahead, check_repeatable
from qcompile.deploy.completion import completed_rewards
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.depth import Depth
from qcompile.deploy.environments import (
    Environment,
    close_environments,
    environment_name,
    policy_environments,
    reward_threshold,
)
from qcompile.deploy.filming import Camera, Frame
from qcompile.deploy.lockstep import Act, Episode, lockstep
from qcompile.deploy.network import NetworkPlayer, refuse_options
from qcompile.deploy.player import Player
from qcompile.deploy.result import Run
from qcompile.deploy.rows import Rows
from qcompile.deploy.settings import RunSettings
from qcompile.deploy.stepping import Stepper
from qcompile.errors import CountsError, EnvironmentMismatchError
from qcompile.execution import load_backend
from qcompile.limits import MAX_EPISODES
from qcompile.policy import AnyPolicy, Policy


def player(
    policy: AnyPolicy, backend: Any, settings: RunSettings | None = None, **changes: Any
) -> Player:
    """A player for a policy: circuits on a backend, or a network, which plays only on `ideal`.

    Raises:
        OptionError: a network is given a backend or setting for circuits.
        QcompileError: as for `Deployment`.
    """
    if isinstance(policy, Policy):
        return Deployment(policy, backend, settings, **changes)
    device = load_backend(backend).device
    refuse_options(policy, [] if device.is_ideal else [f"{option('backend')} {device.name}"])
    return NetworkPlayer(policy, settings, **changes)


class Recorder(Protocol):
    """Records the steps of a run."""

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        """The actions (B,) for observations (B, features), recorded or from `act`."""
        ...

    def rewards(self, rewards: list[float]) -> None:
        """Record the rewards of the last step's actions that counted."""
        ...

    def depth(self, depth: int) -> int:
        """The number of decisions of each episode in the next step; `depth` is the suggestion."""
        return depth

    def predict(self, predict: Act, observations: FloatArray, rows: Rows) -> IntArray:
        """The predicted actions (B,) for the next step, recorded or from `predict`."""
        return predict(observations, rows)


class _Unrecorded(Recorder):
    """Records nothing."""

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        return act(observations, rows)

    def rewards(self, rewards: list[float]) -> None:
        """Ignored: the episodes have them."""


def play(
    player: Player,
    episodes: int | Sequence[int],
    *,
    complete: bool = False,
    recorder: Recorder | None = None,
    on_episode: Callable[[Episode], None] = lambda episode: None,
    on_frame: Callable[[Frame], None] | None = None,
    on_note: Callable[[str], None] = lambda words: None,
) -> Run:
    """Play a number of episodes in lockstep, or the episodes with these numbers, in order.

    Episode i resets with the player's seed + i and draws from its own streams. All running episodes
    step together; for circuits a step is one batch and one job. Ctrl-C ends the run and keeps
    finished episodes; `recorder` sees every step, and `on_frame` gets the frames of the first
    episode. With `complete`, episodes that `max_steps` cut are then completed on the noise model,
    at no cost. If the player's settings speculate, a job measures more than one decision of each
    episode (`deploy/ahead.py`); `on_note` is called if that ends early.

    Raises:
        CountsError: the number of episodes lies outside [1, MAX_EPISODES].
        EnvironmentMismatchError: the environment is unknown or does not fit the policy.
        EnvironmentStepError: it fails in an episode or returns unusable values.
        OptionError: the settings speculate, and the environment keeps running statistics.
    """
    numbers = range(1) if isinstance(episodes, int) else sorted(set(episodes))
    count = episodes if isinstance(episodes, int) else len(numbers)
    if not 1 <= count <= MAX_EPISODES or numbers[0] < 0:
        raise CountsError(
            f"The number of episodes cannot be {count}.", f"It must lie in [1, {MAX_EPISODES}]."
        )
    if isinstance(episodes, int):
        numbers = range(episodes)
    environments = policy_environments(player.policy, len(numbers), film=on_frame is not None)
    recorder, foresight, camera = recorder or _Unrecorded(), None, None
    try:
        if on_frame is not None:
            camera = Camera(player, environments[0], numbers[0], on_frame)
        if player.settings.speculate != 1:
            foresight = _foresight(player, environments, recorder, on_note)
        return _play(
            player, numbers, environments, foresight, recorder, on_episode, camera, complete
        )
    finally:
        close_environments(environments)
        close_environments([] if foresight is None else foresight.scouts)


def _foresight(
    player: Player,
    environments: list[Environment],
    recorder: Recorder,
    on_note: Callable[[str], None],
) -> Foresight:
    """The foresight for the player's episodes in these environments.

    Raises:
        OptionError: the environment keeps running statistics.
    """
    check_repeatable(environments[0])
    try:
        scouts = policy_environments(player.policy, len(environments))
    except EnvironmentMismatchError:
        scouts = []
        name = environment_name(environments[0])
        on_note(f"{name} cannot be created twice: its steps are not measured ahead")
    depth = Depth(player.settings.speculate)

    def next_depth(living: IntArray) -> int:
        rows = Rows(living, np.zeros_like(living))
        return recorder.depth(depth.next(player.load(player.executions(rows))))

    predict = partial(recorder.predict, player.predict)
    return Foresight(predict, scouts, next_depth, depth.note, on_note)


def _play(
    player: Player,
    episodes: Sequence[int],
    environments: list[Environment],
    foresight: Foresight | None,
    recorder: Recorder,
    on_episode: Callable[[Episode], None],
    camera: Camera | None,
    complete: bool,
) -> Run:
    result = Run(player, reward_threshold(environments[0]))
    steppers: list[Stepper] = []
    taken = player.act if camera is None else camera.act

    def begin(begun: Sequence[Stepper]) -> None:
        steppers.extend(begun)
        if camera is not None:
            camera.follow(begun[0])

    def act(observations: FloatArray, rows: Rows) -> IntArray:
        actions = taken(observations, rows)
        result.count_step(rows)  # in measured order: a recorder may have changed it
        return actions

    def note(episode: Episode) -> None:
        result.episodes.append(episode)
        on_episode(episode)

    walk = lockstep if foresight is None else partial(ahead, foresight=foresight)
    started = time.perf_counter()
    try:
        walk(
            partial(recorder.act, act),
            environments,
            player.settings.seed,
            hold=player.policy.hold,
            episodes=episodes,
            max_steps=player.settings.max_steps,
            on_begin=begin,
            on_rewards=recorder.rewards,
            on_episode=note,
        )
    except KeyboardInterrupt:
        result.interrupted = True
    if foresight is None:  # every measured row counts, even if Ctrl-C came before its step
        result.decisions = result.measured_rows
    else:
        hold = player.policy.hold
        result.decisions = sum(-(-stepper.length // hold) for stepper in steppers)
    result.wall_seconds = time.perf_counter() - started
    result.episodes.sort(key=lambda episode: episode.seed)
    result.env_steps = sum(stepper.length for stepper in steppers)
    result.cut_episodes = sum(stepper.is_cut for stepper in steppers)
    if complete and not result.interrupted:
        result.completed = completed_rewards(player, steppers)
    return result
