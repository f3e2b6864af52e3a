"""What a film is told of each step: the `<Z>` that counted, the ideal ones, the probabilities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from qcompile.arrays import FloatArray, IntArray
from qcompile.deploy.filming import Frame, action_names
from qcompile.deploy.lockstep import Act
from qcompile.deploy.network import NetworkPlayer
from qcompile.deploy.play import Recorder, play
from qcompile.deploy.rows import Rows
from qcompile.errors import EnvironmentStepError
from qcompile.policy import Dense, Network

Make = Callable[..., Any]
SCALE = np.array([1.0, 1.0, 4.0, 2.0])
WEIGHTS = np.array([0.5, -0.8, 3.0, -0.5])


class Seen(Recorder):
    """Remembers what the first episode observed, decision by decision."""

    def __init__(self) -> None:
        self.observations: dict[int, FloatArray] = {}

    def act(self, act: Act, observations: FloatArray, rows: Rows) -> IntArray:
        actions = act(observations, rows)
        for row in np.flatnonzero(rows.episode == 0):
            self.observations[int(rows.decision[row])] = observations[row]
        return actions

    def rewards(self, rewards: list[float]) -> None: ...


def filmed(player: Any, episodes: int = 2) -> tuple[list[Frame], Seen]:
    frames: list[Frame] = []
    seen = Seen()
    play(player, episodes, recorder=seen, on_frame=frames.append)
    return frames, seen


def test_the_ideal_is_that_of_the_formula(cartpole: Make, deploy: Make) -> None:
    """<Z> of H, Ry(x), Rz(x), Ry(theta) at theta 0 is -sin x, x the arctan of the feature."""
    frames, seen = filmed(deploy(cartpole(), "fake_lima", shots=64, max_steps=12))
    assert len(frames) == 12
    for frame in frames:
        u = SCALE * seen.observations[frame.decision.number]
        np.testing.assert_allclose(frame.decision.ideal, -u / np.sqrt(1 + u**2), atol=1e-12)


@pytest.mark.parametrize("mitigation", ["none", "readout"])
@pytest.mark.parametrize("policy_hold", [1, 3])
@pytest.mark.parametrize("speculate", [1, 4])
def test_a_frame_has_the_z_of_its_decision(
    cartpole: Make, deploy: Make, speculate: int, policy_hold: int, mitigation: str
) -> None:
    """Another deployment, asked for one decision alone, measures the same: streams are keyed."""
    policy = replace(cartpole(), hold=policy_hold)
    settings = {"shots": 48, "seed": 3, "max_steps": 30, "mitigation": mitigation}
    frames, seen = filmed(deploy(policy, "fake_lima", speculate=speculate, **settings))
    again = deploy(policy, "fake_lima", **settings)
    assert [frame.step for frame in frames] == list(range(1, len(frames) + 1))
    for frame in frames:
        number = frame.decision.number
        assert number == (frame.step - 1) // policy_hold
        rows = Rows(np.array([0]), np.array([number]))
        (z,) = again.expectation(seen.observations[number][None], rows)
        np.testing.assert_array_equal(frame.decision.z, z)
        (action,) = again.act(seen.observations[number][None], rows)
        assert frame.action == action


@pytest.mark.parametrize("settings", [{"copies": 3}, {"copies": 3, "split": True}])
def test_copies_and_split_rows_show_what_counted(
    cartpole: Make, deploy: Make, settings: dict[str, Any]
) -> None:
    settings |= {"shots": 48, "seed": 3, "max_steps": 10, "mitigation": "none"}
    frames, seen = filmed(deploy(cartpole(), "fake_toronto", **settings), 4)
    again = deploy(cartpole(), "fake_toronto", **settings)
    for frame in frames:
        number = frame.decision.number
        rows = Rows(np.array([0]), np.array([number]))
        (z,) = again.expectation(seen.observations[number][None], rows)
        np.testing.assert_array_equal(frame.decision.z, z)


def test_the_probabilities_are_those_of_the_measured_z(cartpole: Make, deploy: Make) -> None:
    """The two logits of `cartpole` are minus and plus half of the weighted sum of -<Z>."""
    policy = cartpole()
    frames, _ = filmed(deploy(policy, "fake_lima", shots=64, max_steps=8))
    for frame in frames:
        logits = policy.weights @ frame.decision.z + policy.bias
        odds = np.exp(logits - logits.max())
        np.testing.assert_allclose(frame.decision.probabilities, odds / odds.sum(), atol=1e-12)
    assert {frame.names for frame in frames} == {("left", "right")}


def test_filming_changes_nothing(cartpole: Make, deploy: Make) -> None:
    settings = {"shots": 32, "seed": 9, "max_steps": 40, "speculate": 3}
    frames: list[Frame] = []
    plain = play(deploy(cartpole(), "fake_lima", **settings), 3)
    film = play(deploy(cartpole(), "fake_lima", **settings), 3, on_frame=frames.append)
    assert film.episodes == plain.episodes
    assert film.load == plain.load
    assert [frames[-1].reward, len(frames)] == [plain.episodes[0].reward, plain.episodes[0].length]


def test_a_network_has_probabilities_alone() -> None:
    layers = [Dense(np.zeros((2, 4)), np.array([0.0, np.log(3.0)]), "none")]
    frames, _ = filmed(NetworkPlayer(Network("net", "CartPole-v1", layers), max_steps=3))
    assert len(frames) == 3
    for frame in frames:
        assert (frame.decision.z.size, frame.decision.ideal.size) == (0, 0)
        np.testing.assert_allclose(frame.decision.probabilities, [0.25, 0.75])


class Fading(gymnasium.Env[Any, Any]):
    """Renders three frames and then `last`, or raises it."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012
    observation_space = Box(-9, 9, (4,), np.float32)
    action_space = Discrete(2)

    def __init__(self, last: Any, render_mode: str | None = None):
        self.render_mode, self._last, self._steps = render_mode, last, 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self._steps = 0
        return np.zeros(4, np.float32), {}

    def step(self, action: int) -> Any:
        self._steps += 1
        return np.zeros(4, np.float32), 1.0, self._steps == 9, False, {}

    def render(self) -> Any:
        if self._steps < 4:
            return np.zeros((4, 6, 3), np.uint8)
        if isinstance(self._last, Exception):
            raise self._last
        return self._last


@pytest.mark.parametrize(
    ("last", "words"),
    [
        (None, "it rendered no picture"),
        (np.zeros((4, 6), np.uint8), "it rendered no picture"),
        (np.zeros((4, 6, 3)), "it rendered no picture"),
        (ValueError("no light"), "no light"),
    ],
)
def test_an_environment_that_stops_rendering_is_named(
    cartpole: Make, deploy: Make, last: Any, words: str
) -> None:
    gymnasium.register("Fading-v0", Fading, kwargs={"last": last})
    try:
        policy = replace(cartpole(), environment="Fading-v0")
        frames: list[Frame] = []
        with pytest.raises(EnvironmentStepError, match=f"step 4: it cannot be filmed: {words}"):
            play(deploy(policy), 1, on_frame=frames.append)
        assert len(frames) == 3
    finally:
        del gymnasium.registry["Fading-v0"]


def named(
    space: Discrete, metadata: Any = None, name: str = "Mine-v0", **own: Any
) -> tuple[str, ...]:
    environment = SimpleNamespace(
        action_space=space,
        metadata=metadata or {},
        unwrapped=SimpleNamespace(spec=SimpleNamespace(id=name), **own),
    )
    return action_names(environment)  # type: ignore[arg-type]


def test_actions_have_the_names_of_their_environment() -> None:
    lander = ("nothing", "left engine", "main engine", "right engine")
    assert named(Discrete(4), name="LunarLander-v3") == lander
    two = Discrete(2)
    assert named(two, {"action_names": ["up", "down"]}) == ("up", "down")
    assert named(two, get_action_meanings=lambda: ["NOOP", "FIRE"]) == ("NOOP", "FIRE")


def test_actions_without_names_have_the_numbers_of_their_environment() -> None:
    assert named(Discrete(3)) == ("0", "1", "2")
    assert named(Discrete(2, start=4)) == ("4", "5")
    assert named(Discrete(2), {"action_names": ["one"]}) == ("0", "1")
    assert named(Discrete(2), {"action_names": "ab"}) == ("0", "1")
    assert named(Discrete(2), get_action_meanings=lambda: 1 / 0) == ("0", "1")
