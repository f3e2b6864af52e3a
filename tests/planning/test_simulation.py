"""Settings are evaluated with whole episodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from qcompile.deploy.settings import RunSettings
from qcompile.errors import OptionError
from qcompile.execution import load_backend
from qcompile.planning import simulation
from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import parallel

STEPS = 30


class Endless(gymnasium.Env[Any, Any]):
    """Ends after `steps`, if at all."""

    observation_space, action_space = Box(0, 1, (1,), np.float32), Discrete(2)

    def __init__(self, steps: int):
        self.steps = steps

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.taken = 0
        return np.full(1, 0.5, np.float32), {}

    def step(self, action: Any) -> Any:
        self.taken += 1
        return np.full(1, 0.5, np.float32), 1.0, self.taken == self.steps, False, {}


gymnasium.register("qcompile_tests/Endless", Endless)

PLAYED: dict[str, Callable[[Policy], Any]] = {
    "random": lambda policy: simulation.random_rewards(policy, 0),
    "ideal": lambda policy: simulation.ideal_rewards(policy, RunSettings(), 2),
    "noisy": lambda policy: (
        simulation.simulate(
            policy, load_backend("fake_lima"), RunSettings(shots=8, mitigation="none"), 2
        ).rewards
    ),
}


@pytest.mark.parametrize("played", PLAYED)
def test_an_episode_that_does_not_end_is_refused(
    played: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulation, "MOST_STEPS", STEPS)
    for steps, is_refused in ((STEPS, False), (STEPS + 1, True)):
        policy = _policy(steps)
        if is_refused:
            with pytest.raises(OptionError, match="did not end within 30 environment steps"):
                PLAYED[played](policy)
        else:
            assert set(PLAYED[played](policy)) == {float(STEPS)}


def _policy(steps: int) -> Policy:
    return Policy(
        "endless",
        "qcompile_tests/Endless",
        Encoder("arctan", np.array([0]), np.ones(1)),
        parallel(1, 1)[0],
        np.array([0.5]),
        np.array([[-1.0], [1.0]]),
        np.zeros(2),
        environment_kwargs={"steps": steps},
    )
