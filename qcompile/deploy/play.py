"""Play episodes with a policy on a backend, all in lockstep."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np

from qcompile.arrays import FloatArray, IntArray
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
    """What plays a policy: circuits on a backend, or a network, which plays on `ideal` alone.

    Raises:
        OptionError: a backend, or a setting, that only circuits have.
        QcompileError: as `Deployment`.
    """
    if isinstance(policy, Policy):
        return Deployment(policy, backend, settings, **changes)
    device = load_backend(backend).device
    refuse_options(policy, [] if device.is_ideal else [f"backend {device.name}"])
    return NetworkPlayer(policy, settings, **changes)


class Recorder(Protocol):
    """Records the steps of a run."""

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        """The actions (B,) for observations (B, features), which `act` may be asked for."""
        ...

    def rewards(self, rewards: list[float]) -> None:
        """What the episodes of the last step earned by its actions: those that counted."""
        ...

    def depth(self, depth: int) -> int:
        """How many decisions of each episode the next step measures; `depth` is what pays."""
        return depth

    def predict(self, predict: Act, observations: FloatArray, rows: Rows) -> IntArray:
        """The actions (B,) along which the next step is measured, which `predict` may be asked."""
        return predict(observations, rows)


class _Unrecorded(Recorder):
    """Records nothing."""

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        return act(observations, rows)

    def rewards(self, rewards: list[float]) -> None:
        """They are those of the episodes."""


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
    """Play so many episodes in lockstep, or those of these numbers, each once, in ascending order.

    Episode i resets with the player's seed + i and draws from streams of its own. All living
    episodes step together: of circuits one batch, one job. Ctrl-C ends the run and keeps what is
    finished; `recorder` sees every step, `on_frame` the frames of the first episode. With
    `complete` the episodes that `max_steps` cut are afterwards played on to their ends on the noise
    model, for nothing. Where the player's settings speculate, a job measures more than one decision
    of each (`deploy/ahead.py`); `on_note` is told where that ends.

    Raises:
        CountsError: the number of episodes lies outside [1, MAX_EPISODES].
        EnvironmentMismatchError: the environment is unknown or does not fit the policy.
        EnvironmentStepError: it fails in an episode, or gives what no policy can use.
        OptionError: the settings speculate, and the environment keeps running statistics.
    """
    numbers = range(1) if isinstance(episodes, int) else sorted(set(episodes))
    count = episodes if isinstance(episodes, int) else len(numbers)
    if not 1 <= count <= MAX_EPISODES or numbers[0] < 0:
        raise CountsError(
            f"{count} episodes cannot be played.", f"Their number lies in [1, {MAX_EPISODES}]."
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
    """What the player's episodes in these environments are run ahead with.

    Raises:
        OptionError: the environment keeps running statistics.
    """
    check_repeatable(environments[0])
    try:
        scouts = policy_environments(player.policy, len(environments))
    except EnvironmentMismatchError:
        scouts = []
        name = environment_name(environments[0])
        on_note(f"{name} cannot be made twice: its steps are not measured ahead")
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
        result.count_step(rows)  # as they were measured: a recorder may have changed their order
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
    if foresight is None:  # all that was measured counts, and what Ctrl-C kept from being taken
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
