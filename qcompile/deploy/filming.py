"""What a film of an episode shows: each picture of the environment, and what led to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete
from numpy.typing import NDArray

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.environments import (
    Environment,
    environment_name,
    frames_per_second,
    is_picture,
)
from qcompile.deploy.player import Player
from qcompile.deploy.rows import Rows
from qcompile.deploy.stepping import Stepper
from qcompile.policy import Policy
from qcompile.terminal import first_line

_NO_CIRCUITS = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Decision:
    """A decision that counted, the `number`-th of its episode, from 0.

    `z` (circuits,) are the `<Z>` as measured and mitigated, `ideal` (circuits,) those of the
    program without noise for the same observation; a network has none. `probabilities` (actions,)
    are what the action was drawn from.
    """

    number: int
    z: FloatArray
    ideal: FloatArray
    probabilities: FloatArray


@dataclass(frozen=True, eq=False)
class Frame:
    """One step of the environment, as a film shows it.

    `picture` (height, width, 3) is what the environment rendered after its `step`-th step, from 1;
    `rate` how many of them make a second. `action`, 0 the first, was taken by `decision` and earned
    the episode `reward` so far. `names` are those of all actions.
    """

    picture: NDArray[np.uint8]
    rate: float
    step: int
    reward: float
    action: int
    names: tuple[str, ...]
    decision: Decision


class Camera:
    """Films the first episode of a run: `on_frame` gets each of its frames.

    Where steps are measured ahead, a decision may be measured more than once; its last measurement
    is the one that counts.
    """

    def __init__(
        self,
        player: Player,
        environment: Environment,
        episode: int,
        on_frame: Callable[[Frame], None],
    ):
        self._player, self._environment, self._episode = player, environment, episode
        self._on_frame = on_frame
        self._rate, self._names = frames_per_second(environment), action_names(environment)
        self._measured: dict[int, tuple[FloatArray, FloatArray]] = {}
        """Observation and values of each decision that the last job measured."""
        self._decision: Decision | None = None
        self._ideal: Deployment | None = None
        if isinstance(player.policy, Policy):
            self._ideal = Deployment(player.policy, "ideal", shots=None)

    def act(self, observations: FloatArray, rows: Rows) -> IntArray:
        """The player's actions (B,) for observations (B, features)."""
        return self._player.act(observations, rows, partial(self._note, observations, rows))

    def _note(self, observations: FloatArray, rows: Rows, values: FloatArray) -> None:
        self._measured = {
            int(rows.decision[row]): (observations[row], values[row])
            for row in np.flatnonzero(rows.episode == self._episode)
        }
        self._decision = None

    def follow(self, stepper: Stepper) -> None:
        """Take a frame after each step of this stepper, which plays the episode."""
        stepper.on_step = partial(self._shoot, stepper)

    def _shoot(self, stepper: Stepper) -> None:
        number = (stepper.length - 1) // self._player.policy.hold
        if self._decision is None or self._decision.number != number:
            self._decision = self._decided(number)
        self._on_frame(
            Frame(
                self._picture(stepper),
                self._rate,
                stepper.length,
                stepper.reward,
                stepper.action,
                self._names,
                self._decision,
            )
        )

    def _picture(self, stepper: Stepper) -> NDArray[np.uint8]:
        try:
            picture = self._environment.render()
        except Exception as error:  # a user's environment may raise anything
            raise stepper.error(f"it cannot be filmed: {first_line(str(error))}") from error
        if not is_picture(picture):
            raise stepper.error("it cannot be filmed: it rendered no picture.")
        return picture

    def _decided(self, number: int) -> Decision:
        observation, values = self._measured[number]
        (probabilities,) = self._player.policy.probabilities(values[None])
        if self._ideal is None:
            return Decision(number, _NO_CIRCUITS, _NO_CIRCUITS, probabilities)
        (ideal,) = self._ideal.expectation(observation[None])
        return Decision(number, values, ideal, probabilities)


_WAYS = ("up", "right", "down", "left")
_NAMES: Mapping[str, tuple[str, ...]] = {
    "Acrobot": ("torque -1", "torque 0", "torque +1"),
    "Blackjack": ("stick", "hit"),
    "CartPole": ("left", "right"),
    "CliffWalking": _WAYS,
    "CliffWalkingSlippery": _WAYS,
    "FrozenLake": ("left", "down", "right", "up"),
    "FrozenLake8x8": ("left", "down", "right", "up"),
    "LunarLander": ("nothing", "left engine", "main engine", "right engine"),
    "MountainCar": ("left", "none", "right"),
    "Taxi": ("south", "north", "east", "west", "pick up", "drop off"),
}
"""The actions of gymnasium's own environments, which say them in their documentation alone."""


def action_names(environment: Environment) -> tuple[str, ...]:
    """The names of an environment's actions: its own, those known of it, or their numbers.

    Its own are `action_names` of its metadata, or what `get_action_meanings` gives, as the Atari
    environments have it.
    """
    space = environment.action_space
    assert isinstance(space, Discrete)
    count, first = int(space.n), int(space.start)
    own = environment.unwrapped
    for given in (
        environment.metadata.get("action_names"),
        _called(getattr(own, "get_action_meanings", None)),
        _NAMES.get(environment_name(environment).partition("-")[0]),
    ):
        if isinstance(given, list | tuple) and len(given) == count:
            return tuple(str(name) for name in given)
    return tuple(str(first + action) for action in range(count))


def _called(function: Any) -> Any:
    """What a method of an environment gives; None where there is none, or it fails."""
    try:
        return function() if callable(function) else None
    except Exception:  # a user's environment may raise anything
        return None
