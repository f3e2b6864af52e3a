"""The one gate to environments: actions by their own numbers, observations and rewards checked.

Gymnasium's checker looks at the first step alone and warns; here every step is checked, and what no
policy can use ends the episode with an error in words.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Discrete
from numpy.typing import NDArray

from qcompile.deploy.environments import Environment, environment_name
from qcompile.errors import EnvironmentStepError
from qcompile.terminal import first_line

_NUMBERS = "biuf"
"""The kinds of numpy types that are real numbers."""
_LARGEST_REWARD = 1e150
"""The squares of larger ones overflow, so that they have no deviation."""


class Stepper:
    """An environment as a policy sees it.

    Actions count from 0, whatever number the environment gives its first one. Observations are
    vectors of the declared number of features, in `dtype`: float32 where that holds every number of
    the declared type, float64 elsewhere. An action is held for `hold` steps, but not beyond the end
    of an episode nor beyond `max_steps` of its steps. `seed` is that of the last reset, `length`
    the environment's steps since, `action` the last one taken and `reward` what they earned;
    `is_over` says that the environment ended the episode. `on_step` is called after each step.
    """

    __slots__ = (
        *("_first_action", "_held", "_left", "_shape", "_step", "action"),
        *("dtype", "environment", "is_over", "length", "max_steps", "observation", "on_step"),
        *("reward", "seed"),
    )

    def __init__(
        self,
        environment: Environment,
        hold: int = 1,
        max_steps: int | None = None,
        on_step: Callable[[], None] | None = None,
    ):
        observed, acted = environment.observation_space, environment.action_space
        assert isinstance(acted, Discrete)
        assert observed.dtype is not None
        self.environment, self._step = environment, environment.step
        self._held, self.max_steps, self.on_step = hold, max_steps, on_step
        self._first_action, self._shape = int(acted.start), observed.shape
        holds_all = np.can_cast(observed.dtype, np.float32)
        self.dtype: np.dtype[Any] = np.dtype(np.float32 if holds_all else np.float64)
        self.seed, self.length, self.reward, self.is_over = 0, 0, 0.0, False
        self.action, self._left = 0, 0

    def reset(self, seed: int) -> NDArray[Any]:
        """Begin an episode; its first observation (features,).

        Raises:
            EnvironmentStepError: the reset fails, or gives no such observation.
        """
        self.seed, self.length, self.reward, self.is_over = seed, 0, 0.0, False
        try:
            answer = self.environment.reset(seed=seed)
        except Exception as error:  # a user's environment may raise anything
            raise self._failed(error) from error
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise self.error(
                f"reset gave {_described(answer)}.", "It must give (observation, info)."
            )
        observation = self._vector(answer[0])
        check_finite([self], observation[None])
        return observation

    def step(self, action: int) -> tuple[NDArray[Any], float, bool, bool]:
        """Hold an action, 0 the first: observation (features,), reward, terminated, truncated.

        The reward is the finite sum over the steps of the hold; whether the observation after the
        last of them is finite, `check_finite` tells for many at once.

        Raises:
            EnvironmentStepError: a step fails, or gives anything else.
        """
        return self._hold(action, self._held)

    def lengthen(self, most_steps: int) -> None:
        """Let a cut episode go on to `most_steps` steps, unfilmed; first what is left of its hold.

        Raises:
            EnvironmentStepError: as `step`.
        """
        self.max_steps, self.on_step = most_steps, None
        if self._left:
            self._hold(self.action, self._left)

    @property
    def has_ended(self) -> bool:
        """Whether the episode is over, by the environment or by `max_steps`."""
        return self.is_over or self.length == self.max_steps

    @property
    def is_cut(self) -> bool:
        """Whether `max_steps` ended the episode, and not the environment."""
        return self.length == self.max_steps and not self.is_over

    def _hold(self, action: int, steps: int) -> tuple[NDArray[Any], float, bool, bool]:
        self.action, earned = action, 0.0
        for self._left in range(steps - 1, -1, -1):
            self.length += 1
            try:
                answer = self._step(self._first_action + action)
            except Exception as error:  # a user's environment may raise anything
                raise self._failed(error) from error
            if type(answer) is not tuple or len(answer) != 5:
                raise self._wrong_step(answer)
            observation, reward, terminated, truncated, _ = answer
            if (
                type(observation) is not np.ndarray
                or observation.shape != self._shape
                or observation.dtype != self.dtype
            ):
                observation = self._vector(observation)
            if type(reward) is not float:  # numpy's own double is a float too, and the usual one
                reward = float(reward) if isinstance(reward, float) else self._number(reward)
            earned += reward
            self.reward += reward
            if not abs(self.reward) <= _LARGEST_REWARD:
                raise self.error(
                    f"the reward is {reward}.",
                    "Rewards and their sum over an episode must be finite, "
                    f"and at most {_LARGEST_REWARD:g}.",
                )
            if type(terminated) is not bool or type(truncated) is not bool:
                terminated, truncated = self._flag(terminated), self._flag(truncated)
            if self.on_step is not None:
                self.on_step()
            if terminated or truncated or self.length == self.max_steps:
                break
        self.observation = observation
        self.is_over = terminated or truncated
        return observation, earned, terminated, truncated

    def error(self, what: str, *hints: str) -> EnvironmentStepError:
        """An error that names the environment, the episode and the step."""
        where = f"step {self.length}" if self.length else "its reset"
        name = environment_name(self.environment)
        return EnvironmentStepError(f"{name}, episode of seed {self.seed}, {where}: {what}", *hints)

    def _failed(self, error: Exception) -> EnvironmentStepError:
        # a wrapper took the answer apart
        if isinstance(error, ValueError | TypeError) and "unpack" in str(error):
            return self._wrong_step(None)
        if isinstance(error, TypeError) and "'seed'" in str(error):
            return self.error(
                "reset takes no seed.", "It must be reset(*, seed=None, options=None)."
            )
        said = first_line(str(error)) or type(error).__name__
        return self.error(f"the environment failed: {said}")

    def _wrong_step(self, answer: Any) -> EnvironmentStepError:
        answered = "another number of values" if answer is None else _described(answer)
        return self.error(
            f"step gave {answered}.",
            "It must give (observation, reward, terminated, truncated, info); four values are the "
            "API of gym before 0.26.",
        )

    def _vector(self, observation: Any) -> NDArray[Any]:
        try:
            array = np.asarray(observation)
        except Exception as error:  # a ragged list, or whatever an object raises
            raise self.error(
                f"the observation is {_described(observation)}.", self._needed()
            ) from error
        if array.shape != self._shape or array.dtype.kind not in _NUMBERS:
            raise self.error(f"the observation is {_described(observation)}.", self._needed())
        with np.errstate(over="ignore"):  # what becomes infinite is told by check_finite
            return array.astype(self.dtype)

    def _needed(self) -> str:
        return f"Its space declares numbers of shape {self._shape}."

    def _number(self, reward: Any) -> float:
        if isinstance(reward, (int, np.generic, np.ndarray)):
            array = np.asarray(reward)
            if array.shape == () and array.dtype.kind in _NUMBERS:
                return float(array)
        raise self.error(f"the reward is {_described(reward)}.", "A reward must be one number.")

    def _flag(self, flag: Any) -> bool:
        if isinstance(flag, int | np.bool_ | np.integer) and flag in (0, 1):
            return bool(flag)
        raise self.error(
            f"terminated and truncated must be true or false, found {_described(flag)}."
        )


def check_finite(steppers: Sequence[Stepper], observations: NDArray[Any]) -> None:
    """Nothing, if the observations (n, features) of these n environments are finite.

    Raises:
        EnvironmentStepError: one is not; the message names the first, and its feature.
    """
    if math.isfinite(np.vdot(observations, observations)):  # the quickest look; it may overflow
        return
    for row, feature in np.argwhere(~np.isfinite(observations)):
        value = observations[row, feature]
        raise steppers[row].error(
            f"feature {feature} of the observation is {value}.", "Observations must be finite."
        )


def _described(value: Any) -> str:
    """What a value is, in a few words."""
    if value is None:
        return "None"
    if isinstance(value, tuple):
        return f"{len(value)} values"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    kind = type(value).__name__
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"
