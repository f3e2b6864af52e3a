"""Environments whose rewards and ends are known in advance, and policies to play them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from qcompile.deploy.deployment import Deployment
from qcompile.device import load_device
from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import parallel
from qcompile.rl.checkpoint import save_checkpoint
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings
from qcompile.simulate import Simulator


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


@pytest.fixture
def cartpole() -> Callable[..., Policy]:
    """Pushes mostly towards the side the pole leans to: y = -sin(x), action 1 is to the right.

    x = arctan(u), u the observation times 1, 1, 4 and 2; the weights are 0.5, -0.8, 3 and -0.5.
    """
    scale, weights = np.array([1.0, 1.0, 4.0, 2.0]), np.array([0.5, -0.8, 3.0, -0.5])

    def make(copies: int = 1) -> Policy:
        program, feature = parallel(4, copies)
        right = np.tile(-weights / copies, copies)
        return Policy(
            "leaning",
            "CartPole-v1",
            Encoder("arctan", np.array(feature), np.tile(scale, copies)),
            program,
            np.zeros(4 * copies),
            np.stack([-right, right]),
            np.zeros(2),
        )

    return make


@pytest.fixture
def stubborn() -> Callable[..., Policy]:
    """Takes the same action whatever it sees."""

    def make(name: str, features: int, actions: int, choice: int = 0) -> Policy:
        program, feature = parallel(features, 1)
        bias = np.zeros(actions)
        bias[choice] = 100.0
        return Policy(
            "stubborn",
            name,
            Encoder("arctan", np.array(feature), np.ones(features)),
            program,
            np.zeros(features),
            np.zeros((actions, features)),
            bias,
        )

    return make


@pytest.fixture
def deploy() -> Callable[..., Deployment]:
    """A policy on a backend by name: exact and unmitigated but for these settings."""

    def make(policy: Policy, backend: str = "ideal", **settings: Any) -> Deployment:
        plain = {"shots": None, "mitigation": "none"}
        return Deployment(policy, load_device(backend), **{**plain, **settings})

    return make


@pytest.fixture
def outputs() -> Callable[[Policy, np.ndarray], np.ndarray]:
    """Logits (B, actions) of a policy as it is, for observations (B, features)."""

    def make(policy: Policy, observations: np.ndarray) -> np.ndarray:
        z = Simulator(policy.program).expectation(policy.encode(observations), policy.theta)
        return policy.logits(z)

    return make


@pytest.fixture(scope="session")
def saved_at() -> Callable[..., None]:
    """Train as far as the n-th update, write a checkpoint there and press Ctrl-C."""

    def make(update: int, environment: str, settings: Settings, path: Path, seed: int = 3) -> None:
        trainer, updates = Trainer(environment, settings, seed), 0

        def stop() -> None:
            nonlocal updates
            updates += 1
            if updates == update:
                save_checkpoint(trainer, path)
                raise KeyboardInterrupt

        assert trainer.train(on_update=stop).interrupted
        assert updates == update

    return make
