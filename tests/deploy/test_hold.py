"""A decision held for several steps: rewards, ends and counts of scripted episodes, by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from gymnasium.wrappers import TimeLimit

from qcompile.deploy.filming import Frame
from qcompile.deploy.network import NetworkPlayer
from qcompile.deploy.play import Recorder, play
from qcompile.deploy.rows import Rows
from qcompile.deploy.stepping import Stepper
from qcompile.policy import Dense, Network

Make = Callable[..., Any]


class Ladder(gymnasium.Env[Any, Any]):
    """Step k, from 0, pays 10^k, so that a sum shows its steps. Ends after `ends` steps.

    With `seeded` the seed is the number of steps. It observes the steps taken.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012

    def __init__(self, ends: int = 10, seeded: bool = False, render_mode: str | None = None):
        self.observation_space, self.action_space = Box(0, 99, (1,), np.float32), Discrete(2)
        self.ends, self.seeded, self.render_mode = ends, seeded, render_mode
        self.sent: list[int] = []

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.sent = []
        if self.seeded and seed is not None:
            self.ends = seed
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> Any:
        self.sent.append(int(action))
        count = len(self.sent)
        seen = np.full(1, count, np.float32)
        return seen, 10.0 ** (count - 1), count == self.ends, False, {}

    def render(self) -> Any:
        return np.full((16, 16, 3), len(self.sent), np.uint8)


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    gymnasium.register("Ladder-v0", Ladder, kwargs={"seeded": True})
    gymnasium.register("Ladder-v1", Ladder, kwargs={"seeded": True}, max_episode_steps=6)
    yield
    del gymnasium.registry["Ladder-v0"], gymnasium.registry["Ladder-v1"]


def held(environment: gymnasium.Env[Any, Any], hold: int, actions: list[int], **limit: Any) -> Any:
    """The answers to these actions, as (steps seen, reward, terminated, truncated)."""
    stepper = Stepper(environment, hold, **limit)
    stepper.reset(0)
    answers = []
    for action in actions:
        seen, *others = stepper.step(action)
        answers.append((seen.tolist()[0], *others))
    return answers, stepper


def test_rewards_are_summed_and_a_termination_breaks_the_hold() -> None:
    ladder = Ladder(ends=5)
    answers, stepper = held(ladder, 3, [1, 0])
    assert answers == [(3, 111.0, False, False), (5, 11000.0, True, False)]
    assert ladder.sent == [1, 1, 1, 0, 0]
    assert (stepper.length, stepper.reward, stepper.is_over) == (5, 11111.0, True)


@pytest.mark.parametrize(("limit", "second"), [(4, 1000.0), (5, 11000.0), (6, 111000.0)])
def test_a_time_limit_breaks_the_hold_at_its_own_step(limit: int, second: float) -> None:
    ladder = Ladder()
    answers, stepper = held(TimeLimit(ladder, limit), 3, [1, 0])
    assert answers == [(3, 111.0, False, False), (limit, second, False, True)]
    assert ladder.sent == [1, 1, 1, 0, 0, 0][:limit]
    assert stepper.is_over


@pytest.mark.parametrize(("most", "cut"), [(3, True), (4, True), (5, False), (7, False)])
def test_max_steps_counts_environment_steps(most: int, cut: bool) -> None:
    """The environment ends after five: then it is not `max_steps` that ends the episode."""
    answers, stepper = held(Ladder(ends=5), 3, [1, 0][: 1 + (most > 3)], max_steps=most)
    assert stepper.length == min(most, 5)
    assert stepper.reward == sum(10.0**k for k in range(stepper.length))
    assert stepper.is_cut is cut
    assert answers[-1][2] is not cut


def test_a_cut_hold_goes_on_where_it_broke_off() -> None:
    ladder = Ladder(ends=8)
    _, stepper = held(ladder, 3, [1, 0], max_steps=4)
    stepper.lengthen(100)
    assert (ladder.sent, stepper.length, stepper.is_over) == ([1, 1, 1, 0, 0, 0], 6, False)
    assert stepper.observation.tolist() == [6]
    stepper.step(1)
    assert (ladder.sent[6:], stepper.reward, stepper.is_over) == ([1, 1], 11111111.0, True)


def test_a_step_of_a_hold_is_seen_by_itself() -> None:
    seen: list[int] = []
    ladder = Ladder(ends=5)
    held(ladder, 3, [1, 0], on_step=lambda: seen.append(len(ladder.sent)))
    assert seen == [1, 2, 3, 4, 5]


class Kept(Recorder):
    """Records the calls of a recorder."""

    def __init__(self) -> None:
        self.rows: list[tuple[list[int], list[int]]] = []
        self.seen: list[list[float]] = []
        self.earned: list[list[float]] = []

    def act(self, act: Any, observations: np.ndarray, rows: Rows) -> Any:
        self.rows.append((rows.episode.tolist(), rows.decision.tolist()))
        self.seen.append(observations[:, 0].tolist())
        return act(observations, rows)

    def rewards(self, rewards: list[float]) -> None:
        self.earned.append(rewards)


def test_decisions_and_environment_steps_by_hand(stubborn: Make, deploy: Make) -> None:
    """Episodes of 3, 4, 5 and 6 steps (TimeLimit 6), held for 2: 2, 2, 3 and 3 decisions."""
    policy = replace(stubborn("Ladder-v1", 1, 2), hold=2)
    recorder = Kept()
    result = play(deploy(policy, shots=10, seed=3), 5, recorder=recorder)
    lengths = [3, 4, 5, 6, 6]
    assert [episode.length for episode in result.episodes] == lengths
    assert result.rewards.tolist() == [(10.0**n - 1) / 9 for n in lengths]
    assert (result.decisions, result.env_steps, result.steps) == (13, 24, 3)
    assert (result.load.jobs, result.load.executions) == (3, 130)
    everyone = [0, 1, 2, 3, 4]
    assert recorder.rows == [(everyone, [0] * 5), (everyone, [1] * 5), ([2, 3, 4], [2] * 3)]
    assert recorder.seen == [[0.0] * 5, [2.0] * 5, [4.0] * 3]
    assert recorder.earned == [[11.0] * 5, [100.0, *[1100.0] * 4], [1e4, 1.1e5, 1.1e5]]
    summary = result.summary()
    assert [summary[key] for key in ("hold", "decisions", "env_steps", "jobs")] == [2, 13, 24, 3]


@pytest.mark.parametrize("most", [1, 2, 3, 4])
def test_cut_episodes_are_those_that_the_environment_had_not_ended(
    stubborn: Make, deploy: Make, most: int
) -> None:
    """Episodes of 1, 2, 3 and 4 steps: the one of exactly `max_steps` ends on its own."""
    policy = replace(stubborn("Ladder-v0", 1, 2), hold=3)
    result = play(deploy(policy, seed=1, max_steps=most), 4)
    assert result.cut_episodes == 4 - most
    assert result.env_steps == sum(min(n, most) for n in (1, 2, 3, 4))
    assert result.summary()["cut_episodes"] == 4 - most


@pytest.mark.parametrize("depth", [1, 3])
def test_every_frame_of_a_hold_is_shown(stubborn: Make, deploy: Make, depth: int) -> None:
    """Of the first episode alone, one after each of its five steps, at the environment's rate.

    Measured ahead as well: what a scout sees is not filmed.
    """
    policy = replace(stubborn("Ladder-v0", 1, 2), hold=3)
    frames: list[Frame] = []
    play(deploy(policy, shots=10, seed=5, speculate=depth), 2, on_frame=frames.append)
    assert [int(frame.picture[0, 0, 0]) for frame in frames] == [1, 2, 3, 4, 5]
    assert [frame.decision.number for frame in frames] == [0, 0, 0, 1, 1]
    assert {frame.rate for frame in frames} == {25.0}


def test_a_cut_film_ends_with_the_cut(stubborn: Make, deploy: Make) -> None:
    policy = replace(stubborn("Ladder-v0", 1, 2), hold=3)
    frames: list[Frame] = []
    run = play(deploy(policy, seed=6, max_steps=4), 1, complete=True, on_frame=frames.append)
    assert [int(frame.picture[0, 0, 0]) for frame in frames] == [1, 2, 3, 4]
    assert run.completed is not None


def test_a_network_holds_its_decisions_too() -> None:
    layers = [Dense(np.zeros((2, 1)), np.array([0.0, 9.0]), "none")]
    network = Network("net", "Ladder-v0", layers, hold=4)
    summary = play(NetworkPlayer(network, seed=5), 2).summary()
    assert [episode["length"] for episode in summary["episodes"]] == [5, 6]
    assert [summary[key] for key in ("hold", "decisions", "env_steps")] == [4, 4, 11]
