"""The only access to environments: maps actions, and checks observations and rewards.

Gymnasium's checker only warns, and only on the first step; here every step is checked, and unusable
values end the episode with an explained error.
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
"""Squares of larger rewards overflow, so that no standard deviation exists."""


class Stepper:
    """An environment as a policy sees it.

    Actions count from 0, whatever the environment's first number. Observations are vectors with the
    declared number of features, in `dtype`: float32 if that holds every number of the declared
    type, else float64. An action is held for `hold` steps, but not beyond the end of an episode or
    `max_steps` steps. `seed` is the seed of the last reset, `length` the number of environment
    steps since, `action` the last one taken and `reward` the total; `is_over` says whether the
    environment ended the episode. `on_step` is called after each step.
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
        """Begin an episode; return its first observation (features,).

        Raises:
            EnvironmentStepError: the reset fails or returns another observation.
        """
        self.seed, self.length, self.reward, self.is_over = seed, 0, 0.0, False
        try:
            answer = self.environment.reset(seed=seed)
        except Exception as error:  # a user's environment may raise anything
            raise self._failed(error) from error
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise self.error(
                f"reset returned {_described(answer)}.", "It must return (observation, info)."
            )
        observation = self._vector(answer[0])
        check_finite([self], observation[None])
        return observation

    def step(self, action: int) -> tuple[NDArray[Any], float, bool, bool]:
        """Hold an action, counted from 0; return observation, reward, terminated and truncated.

        The reward is the finite sum over the held steps. The observation (features,) after the last
        one is not checked to be finite: `check_finite` does that for many at once.

        Raises:
            EnvironmentStepError: a step fails or returns anything else.
        """
        return self._hold(action, self._held)

    def lengthen(self, most_steps: int) -> None:
        """Extend a cut episode to `most_steps` steps, unfilmed, and finish its held action.

        Raises:
            EnvironmentStepError: as for `step`.
        """
        self.max_steps, self.on_step = most_steps, None
        if self._left:
            self._hold(self.action, self._left)

    @property
    def has_ended(self) -> bool:
        """Whether the environment or `max_steps` ended the episode."""
        return self.is_over or self.length == self.max_steps

    @property
    def is_cut(self) -> bool:
        """Whether `max_steps`, not the environment, ended the episode."""
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
            if type(reward) is not float:  # numpy's double, the usual type, is a float too
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
        """An error naming the environment, the episode and the step."""
        where = f"step {self.length}" if self.length else "its reset"
        name = environment_name(self.environment)
        return EnvironmentStepError(f"{name}, episode of seed {self.seed}, {where}: {what}", *hints)

    def _failed(self, error: Exception) -> EnvironmentStepError:
        # a wrapper unpacked the answer
        if isinstance(error, ValueError | TypeError) and "unpack" in str(error):
            return self._wrong_step(None)
        if isinstance(error, TypeError) and "'seed'" in str(error):
            return self.error(
                "reset does not accept a seed.",
                "Its signature must be reset(*, seed=None, options=None).",
            )
        message = first_line(str(error)) or type(error).__name__
        return self.error(f"the environment failed: {message}")

    def _wrong_step(self, answer: Any) -> EnvironmentStepError:
        returned = "a wrong number of values" if answer is None else _described(answer)
        return self.error(
            f"step returned {returned}.",
            "It must return (observation, reward, terminated, truncated, info); four values are "
            "the "
            "API of gym before 0.26.",
        )

    def _vector(self, observation: Any) -> NDArray[Any]:
        try:
            array = np.asarray(observation)
        except Exception as error:  # a ragged list, or an object that raises
            raise self.error(
                f"the observation is {_described(observation)}.", self._needed()
            ) from error
        if array.shape != self._shape or array.dtype.kind not in _NUMBERS:
            raise self.error(f"the observation is {_described(observation)}.", self._needed())
        with np.errstate(over="ignore"):  # check_finite reports infinite values
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
        raise self.error(f"terminated and truncated must be true or false, not {_described(flag)}.")


def check_finite(steppers: Sequence[Stepper], observations: NDArray[Any]) -> None:
    """Check that the observations (n, features) of these n environments are finite.

    Raises:
        EnvironmentStepError: one is not; the message names the first and its feature.
    """
    if math.isfinite(np.vdot(observations, observations)):  # the fastest check; it may overflow
        return
    for row, feature in np.argwhere(~np.isfinite(observations)):
        value = observations[row, feature]
        raise steppers[row].error(
            f"feature {feature} of the observation is {value}.", "Observations must be finite."
        )


def _described(value: Any) -> str:
    """A short description of a value."""
    if value is None:
        return "None"
    if isinstance(value, tuple):
        return f"{len(value)} values"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    kind = type(value).__name__
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"
