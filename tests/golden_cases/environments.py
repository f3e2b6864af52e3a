"""Environments that fail in an episode, or give what no policy can use, or cannot be filmed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, Text

from .case import Command
from .inputs import policy, write

SEEN = np.zeros(4, np.float32)


class Odd(gymnasium.Env[Any, Any]):
    """Gives what it is told to, from its second step on."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 30}
    observation_space = Box(-1, 1, (4,), np.float32)
    action_space = Discrete(2)

    def __init__(self, first: Any = None, then: Any = None, frame: Any = None, **_: Any):
        self.first = (SEEN, {}) if first is None else first
        self.then, self.frame, self.render_mode = then, frame, "rgb_array"

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.steps = 0
        return _given(self.first)

    def step(self, action: Any) -> Any:
        self.steps += 1
        return (SEEN, 1.0, False, False, {}) if self.steps == 1 else _given(self.then)

    def render(self) -> Any:
        return _given(self.frame)


class Wordy(Odd):
    """Observes a text beside numbers."""

    observation_space = Dict({"mission": Text(20), "place": Discrete(4)})  # type: ignore[assignment]


class Seedless(Odd):
    """Takes no seed."""

    def reset(self, *, options: Any = None) -> Any:  # type: ignore[override]
        return SEEN, {}


def _given(value: Any) -> Any:
    if isinstance(value, Exception):
        raise value
    return value


def then(observation: Any = SEEN, reward: Any = 1.0, ended: Any = True) -> dict[str, Any]:
    return {"then": (observation, reward, ended, False, {})}


ENVIRONMENTS: dict[str, dict[str, Any]] = {
    "reset raises an error": {"first": RuntimeError("the wheel is off\nand more")},
    "reset gives an observation alone": {"first": SEEN},
    "reset gives nan": {"first": (np.full(4, np.nan, np.float32), {})},
    "reset gives three numbers": {"first": (np.zeros(3, np.float32), {})},
    "step raises an error": {"then": ZeroDivisionError()},
    "step gives four values": {"then": (SEEN, 1.0, True, {})},
    "step gives None": {"then": None},
    "step gives a text": then("a long way"),
    "step gives a ragged list": then([[1.0], [1.0, 2.0]]),
    "step gives a matrix": then(np.zeros((2, 2), np.float32)),
    "step gives infinity": then(np.full(4, np.inf, np.float32)),
    "the reward is nan": then(reward=float("nan")),
    "the reward is huge": then(reward=1e300),
    "the reward is a text": then(reward="much"),
    "the reward is an array": then(reward=np.zeros(3)),
    "terminated is a text": then(ended="yes"),
}
FRAMES: dict[str, Any] = {
    "a frame is None": None,
    "a frame is a text": "text",
    "a frame is of floats": np.zeros((4, 5, 3)),
    "rendering fails": ImportError("no pygame"),
}


def registered(make: Callable[..., Any], **options: Any) -> Callable[[pytest.MonkeyPatch], None]:
    """Odd-v0 is this environment for once."""

    def change(patch: pytest.MonkeyPatch) -> None:
        spec = gymnasium.envs.registration.EnvSpec(
            "Odd-v0", entry_point=make, disable_env_checker=True, kwargs=options
        )
        patch.setitem(gymnasium.registry, "Odd-v0", spec)

    return change


def broken(**_: Any) -> Any:
    raise ZeroDivisionError("no wheels\nat all")


def unfinished(**_: Any) -> Any:
    raise ImportError("it needs wheels: pip install wheels")


def files() -> None:
    write({"odd.json": policy(environment="Odd-v0"), "fails.py": "import gymnasium\n1 / 0\n"})


TRAIN = "train --out p.pt"
RUN = "run odd.json --episodes 1 --shots exact --greedy"

CASES = (
    *(Command(RUN, what, registered(Odd, **options)) for what, options in ENVIRONMENTS.items()),
    Command(RUN, "reset does not accept a seed", registered(Seedless)),
    Command(RUN, "its own code fails", registered(broken)),
    Command(RUN, "it needs a package", registered(unfinished)),
    *(
        Command(f"{RUN} --video a.gif", what, registered(Odd, frame=frame))
        for what, frame in FRAMES.items()
    ),
    Command(
        "train Odd-v0 --episodes 3 --out odd.pt",
        "step gives infinity",
        registered(Odd, **ENVIRONMENTS["step gives infinity"]),
        masked=True,
    ),
    Command(f"{TRAIN} Odd-v0", "it observes a text", registered(Wordy)),
    Command(f"{TRAIN} Nowhere-v0"),
    Command(f"{TRAIN} Taxi-v3"),
    Command(f"{TRAIN} CartPoel-v1"),
    Command(f"{TRAIN} mine:Corridor-v0"),
    Command(f"{TRAIN} Pendulum-v1"),
    Command(f"{TRAIN} CarRacing-v3 --env continuous=false"),
    Command(f"{TRAIN} CartPole-v1 --import nosuch"),
    Command(f"{TRAIN} CartPole-v1 --import nosuch.py"),
    Command(f"{TRAIN} CartPole-v1 --import fails.py"),
    Command(f"{TRAIN} CartPole-v1 --env wind=3"),
    Command(f"{TRAIN} CartPole-v1 --env track=../a.xml"),
    Command(f"{TRAIN} CartPole-v1 --env max_episode_steps=0"),
    Command(f"{TRAIN} CartPole-v1 --env gravity"),
    Command(f"{TRAIN} CartPole-v1 --env gravity=1 --env gravity=2"),
    Command("run cartpole --env id=Acrobot-v1"),
    Command("evaluate --paper --env gravity=1"),
)
