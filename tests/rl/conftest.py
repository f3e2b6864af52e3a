"""Environments whose rewards and ends are known in advance."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete


class Clock(gymnasium.Env[Any, Any]):
    """Observes [episode, step]; step k of episode e pays 10 e + k + action / 2.

    Episodes last `length` steps; odd ones (the first is 1) terminate, even ones are truncated,
    `both` makes the last step do both.
    """

    def __init__(self, length: int = 3, both: bool = False, render_mode: str | None = None):
        self.observation_space = Box(-np.inf, np.inf, (2,), np.float32)
        self.action_space = Discrete(3)
        self.render_mode = render_mode
        self.length, self.both = length, both
        self.episode = self.step_index = 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.episode, self.step_index = self.episode + 1, 0
        return self._observe(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.step_index += 1
        ended = self.step_index == self.length
        odd = self.episode % 2 == 1
        reward = 10.0 * self.episode + self.step_index + action / 2
        return self._observe(), reward, ended and odd, ended and (self.both or not odd), {}

    def _observe(self) -> Any:
        return np.array([self.episode, self.step_index], dtype=np.float32)


class Match(gymnasium.Env[Any, Any]):
    """A bandit with a context: pays 1 for the action that the sign of its one feature names."""

    def __init__(self, render_mode: str | None = None):
        self.observation_space = Box(-1, 1, (1,), np.float32)
        self.action_space = Discrete(2)
        self.render_mode = render_mode

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.step_index = 0
        return self._observe(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        reward = float(action == (self.feature > 0))
        self.step_index += 1
        return self._observe(), reward, self.step_index == 20, False, {}

    def _observe(self) -> Any:
        self.feature = float(self.np_random.choice([-1.0, 1.0]))
        return np.array([self.feature], dtype=np.float32)


@pytest.fixture(autouse=True, scope="session")
def known_environments() -> Iterator[None]:
    """Register them by name; ClockPaid-v0 has a reward threshold."""
    made = {
        "Clock-v0": (Clock, {}),
        "ClockBoth-v0": (Clock, {"length": 2, "both": True}),
        "ClockPaid-v0": (Clock, {}),
        "Match-v0": (Match, {}),
    }
    for name, (environment, settings) in made.items():
        gymnasium.register(
            name,
            environment,
            reward_threshold=40.0 if name == "ClockPaid-v0" else None,
            disable_env_checker=True,
            kwargs=settings,
        )
    yield
    for name in made:
        del gymnasium.registry[name]
