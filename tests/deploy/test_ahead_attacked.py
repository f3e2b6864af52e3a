"""Environments that cannot be run ahead, or barely: the law holds, and a message says so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from traced import drawn_policy, traced

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.errors import EnvironmentStepError
from qcompile.policy import Policy

LENGTH = 25


class Walk(gymnasium.Env[Any, Any]):
    """A walk of 25 steps, moved by the action and a random number; it pays its position.

    `made` holds every environment created, of episodes and scouts.
    """

    made: ClassVar[list[Any]] = []

    def __init__(self, render_mode: str | None = None):
        self.observation_space, self.action_space = Box(-99, 99, (2,), np.float32), Discrete(2)
        self.render_mode, self.is_closed, self.taken = render_mode, False, 0
        self.length = LENGTH
        type(self).made.append(self)

    @property
    def is_scout(self) -> bool:
        """Whether it came after the environments of three episodes."""
        return self.made.index(self) >= 3

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.place, self.count = self.np_random.normal(), 0
        return self.seen(), {}

    def step(self, action: Any) -> Any:
        self.count, self.taken = self.count + 1, self.taken + 1
        self.place += 0.4 * (2 * action - 1) + 0.1 * self.np_random.normal()
        return self.seen(), float(self.place), self.count >= self.length, False, {}

    def seen(self) -> Any:
        return np.array([self.place, self.count / LENGTH], np.float32)

    def close(self) -> None:
        self.is_closed = True


class Unseeded(Walk):
    """Its episodes start as seeded and continue at random."""

    def step(self, action: Any) -> Any:
        self.place += 0.01 * np.random.default_rng().normal()
        return super().step(action)


class Late(Walk):
    """Random only in its twentieth step."""

    def step(self, action: Any) -> Any:
        if self.count == 19:
            self.place += 0.01 * np.random.default_rng().normal()
        return super().step(action)


class RewardByChance(Walk):
    """Only its rewards are random, not its observations."""

    def step(self, action: Any) -> Any:
        seen, _, *ends = super().step(action)
        return seen, float(np.random.default_rng().normal()), *ends


class Edge(Walk):
    """A scout fails at a position that no episode has reached."""

    reached: ClassVar[set[bytes]] = set()

    def seen(self) -> Any:
        observation = super().seen()
        if not self.is_scout:
            self.reached.add(observation.tobytes())
        elif observation.tobytes() not in self.reached:
            raise ZeroDivisionError("over the edge")
        return observation


class FailsAhead(Walk):
    """A scout fails in its seventh step; the episode does not."""

    def step(self, action: Any) -> Any:
        if self.is_scout and self.count == 6:
            raise ZeroDivisionError("only ahead")
        return super().step(action)


class NotANumberAhead(Walk):
    """A scout observes NaN in its fifth step."""

    def seen(self) -> Any:
        if self.is_scout and self.count == 5:
            return np.full(2, np.nan, np.float32)
        return super().seen()


class Aliased(Walk):
    """Returns the same array every time, and writes to it."""

    def seen(self) -> Any:
        if not hasattr(self, "array"):
            self.array = np.zeros(2, np.float32)
        self.array[:] = super().seen()
        return self.array


class Statistics(Walk):
    """Normalises by the mean of everything it has seen, with its own arithmetic."""

    sums: float = 0.0
    seen_count: int = 0

    def seen(self) -> Any:
        self.sums, self.seen_count = self.sums + self.place, self.seen_count + 1
        return super().seen() - np.float32(self.sums / self.seen_count)


class Short(Walk):
    """Over after its first step, and where the seed is odd after its second."""

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.length = 1 + (seed or 0) % 2
        return super().reset(seed=seed)


class Fails(Walk):
    """Fails in its twelfth step, in any environment."""

    def step(self, action: Any) -> Any:
        if self.count == 11:
            raise ZeroDivisionError("for all")
        return super().step(action)


class Stops(Walk):
    """Ctrl-C is pressed when a scout has taken twelve steps."""

    def step(self, action: Any) -> Any:
        if self.is_scout and self.taken == 12:
            raise KeyboardInterrupt
        return super().step(action)


KINDS = {
    kind.__name__: kind
    for kind in (
        *(Walk, Edge, Unseeded, Late, RewardByChance, FailsAhead, NotANumberAhead, Aliased),
        *(Statistics, Short, Fails, Stops),
    )
}


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    for name, kind in KINDS.items():
        gymnasium.register(f"{name}-v0", kind, max_episode_steps=100)
    yield
    for name, kind in KINDS.items():
        del gymnasium.registry[f"{name}-v0"]
        kind.made.clear()


def walker(kind: type[Walk], **changes: Any) -> Policy:
    return drawn_policy(f"{kind.__name__}-v0", [0, 1], 2, 5, **changes)


def played(policy: Policy, depth: Any, **settings: Any) -> tuple[Any, Any, list[str]]:
    """A run, its actions and its messages; the environments of the last run are forgotten."""
    Walk.made.clear()
    said: list[str] = []
    given = {"shots": 24, "mitigation": "none", "seed": 4, **settings}
    player = Deployment(policy, "fake_lima", speculate=depth, **given)
    run, actions = traced(player, 3, on_note=said.append)
    return run, actions, said


def words(kind: type[Walk]) -> str:
    return f"{kind.__name__}-v0 does not repeat itself: steps are no longer measured ahead"


@pytest.mark.parametrize("hold", [1, 3])
@pytest.mark.parametrize("kind", [Walk, Edge, Aliased, Short])
def test_these_are_exact_all_the_same(kind: type[Walk], hold: int) -> None:
    """Scouts that fail end only their own chains."""
    policy = walker(kind, hold=hold)
    plain, taken, _ = played(policy, 1)
    for depth in (4, 16, "auto"):
        run, actions, said = played(policy, depth)
        assert run.episodes == plain.episodes
        assert (actions, said) == (taken, [])
        assert run.decisions == plain.decisions
        assert kind is Short or run.steps < plain.steps
        assert all(environment.is_closed for environment in Walk.made)
        assert len(Walk.made) == 6


@pytest.mark.parametrize("kind", [FailsAhead, NotANumberAhead])
def test_a_scout_that_fails_where_its_episode_does_not(kind: type[Walk]) -> None:
    """Only it is lost: its episode continues decision by decision."""
    plain, taken, _ = played(walker(kind), 1)
    run, actions, said = played(walker(kind), 8)
    assert (run.episodes, actions, said) == (plain.episodes, taken, [])


def test_statistics_of_its_own_end_the_looking_ahead_and_change_nothing() -> None:
    """A rebuilt scout has seen more than the episode: this is detected, and the rest is exact."""
    policy = walker(Statistics)
    plain, taken, _ = played(policy, 1)
    run, actions, said = played(policy, 8)
    assert said == [words(Statistics)]
    assert (run.episodes, actions) == (plain.episodes, taken)
    assert run.measured_rows > run.decisions


@pytest.mark.parametrize("kind", [Unseeded, Late, RewardByChance])
def test_what_does_not_repeat_itself_is_found_at_once(kind: type[Walk]) -> None:
    """Then a job measures one decision of each, and every action follows from its observation."""
    run, actions, said = played(walker(kind), 16)
    assert said == [words(kind)]
    assert [episode.length for episode in run.episodes] == [LENGTH] * 3
    assert [len(taken) for taken in actions.values()] == [LENGTH] * 3
    assert run.decisions == 3 * LENGTH
    if kind is not Late:  # one job, and then all one by one but for what it gave
        assert run.steps >= LENGTH - 1


@pytest.mark.parametrize("kind", [Unseeded, Late, RewardByChance, Statistics])
def test_each_action_was_measured_on_what_its_episode_observed(kind: type[Walk]) -> None:
    """Compares the measured observations of rows that counted with those of the episode."""
    seen: dict[int, list[bytes]] = {}
    measured: dict[tuple[int, int], list[bytes]] = {}
    policy = walker(kind)
    player = Deployment(policy, "fake_lima", speculate=8, shots=24, mitigation="none", seed=4)
    act = player.act

    def watched(observations: Any, rows: Any = None) -> Any:
        for row, episode, decision in zip(observations, *rows[:2], strict=True):
            measured.setdefault((episode, decision), []).append(row.tobytes())
        return act(observations, rows)

    player.act = watched  # type: ignore[method-assign]
    Walk.made.clear()
    original = kind.step

    def step(self: Any, action: Any) -> Any:
        answer = original(self, action)
        if not self.is_scout:
            seen[self.made.index(self)].append(answer[0].astype(float).tobytes())
        return answer

    first = kind.reset

    def reset(self: Any, **words: Any) -> Any:
        answer = first(self, **words)
        if not self.is_scout:
            seen[self.made.index(self)] = [answer[0].astype(float).tobytes()]
        return answer

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kind, "step", step)
        patch.setattr(kind, "reset", reset)
        run = play(player, 3)
    assert run.decisions == 3 * LENGTH
    for episode, observations in seen.items():
        for decision, observed in enumerate(observations[:-1]):
            assert measured[episode, decision][-1] == observed, "the last one counts"


def test_an_environment_that_fails_fails_the_run_as_ever() -> None:
    said = []
    for depth in (1, 16):
        with pytest.raises(EnvironmentStepError) as caught:
            played(walker(Fails), depth)
        said.append(str(caught.value))
        assert all(environment.is_closed for environment in Walk.made)
    assert (
        said[0]
        == said[1]
        == ("Fails-v0, episode of seed 4, step 12: the environment failed: for all")
    )


def test_ctrl_c_in_a_scout_stops_the_run() -> None:
    run, _, _ = played(walker(Stops), 16)
    assert run.interrupted
    assert run.summary()["mean_reward"] is None
    assert all(environment.is_closed for environment in Walk.made)


def test_a_cut_falls_where_it_falls() -> None:
    for most in (1, 2, 7, LENGTH, LENGTH + 1):
        policy = replace(walker(Walk), hold=3)
        plain, taken, _ = played(policy, 1, max_steps=most)
        run, actions, _ = played(policy, 16, max_steps=most)
        assert (run.episodes, actions) == (plain.episodes, taken)
        assert run.cut_episodes == plain.cut_episodes == 3 * (most < LENGTH)


def test_no_action_of_a_scout_is_an_action_of_the_episode() -> None:
    """An episode takes one step per decision, however often scouts are rebuilt."""
    played(walker(Walk), 16)
    assert [environment.taken for environment in Walk.made[:3]] == [LENGTH] * 3
    assert max(environment.taken for environment in Walk.made[3:]) > LENGTH
