"""Steps measured ahead: jobs, rows and episodes worked out by hand on scripted environments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete
from gymnasium.wrappers import NormalizeObservation, NormalizeReward, TimeLimit

from qcompile.deploy.ahead import Foresight, ahead, check_repeatable
from qcompile.deploy.lockstep import Episode, lockstep
from qcompile.deploy.rows import Rows
from qcompile.deploy.stepping import Stepper
from qcompile.errors import EnvironmentStepError, OptionError


class Path(gymnasium.Env[Any, Any]):
    """Observes its seed and its actions so far as a binary number that begins with 1.

    Action a at step k, from 1 on, pays k + a / 2. It ends after `length` steps, or where `ends`
    holds the number; it fails where `fails` does.
    """

    def __init__(self, length: int = 6, ends: Sequence[int] = (), fails: Sequence[int] = ()):
        self.observation_space = Box(-np.inf, np.inf, (2,), np.float64)
        self.action_space = Discrete(2)
        self.length, self.ends, self.fails = length, ends, fails
        self.resets = self.steps = 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        self.seed, self.number, self.resets = seed, 1, self.resets + 1
        return self.observed(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.number = 2 * self.number + int(action)
        self.steps += 1
        if self.number in self.fails:
            raise RuntimeError("stuck")
        step = self.number.bit_length() - 1
        over = self.number in self.ends
        return self.observed(), step + action / 2, over, step == self.length, {}

    def observed(self) -> Any:
        return np.array([self.seed, self.number], dtype=np.float64)


@dataclass
class Script:
    """Predicted and measured actions of each episode, and a record of the requests.

    A decision that is measured again gives the next of its measured actions, if there are several.
    """

    predicted: Sequence[str]
    measured: Sequence[str]
    again: dict[tuple[int, int], str] = field(default_factory=dict)
    depth: int = 3
    jobs: list[list[tuple[int, int, int]]] = field(default_factory=list)
    """(episode, decision, number that is observed) of every row of every job."""
    noted: list[tuple[int, int]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    rewards: list[list[float]] = field(default_factory=list)
    episodes: list[Episode] = field(default_factory=list)

    def predict(self, observations: Any, rows: Rows) -> Any:
        pairs = zip(rows.episode.tolist(), rows.decision.tolist(), strict=True)
        return np.array([int(self.predicted[e][d]) for e, d in pairs])

    def act(self, observations: Any, rows: Rows) -> Any:
        places = list(zip(rows.episode.tolist(), rows.decision.tolist(), strict=True))
        seen = {row[:2] for job in self.jobs for row in job}
        self.jobs.append(
            [(*place, int(o[1])) for place, o in zip(places, observations, strict=True)]
        )
        return np.array(
            [
                int(
                    self.again[place]
                    if place in seen and place in self.again
                    else self.measured[place[0]][place[1]]
                )
                for place in places
            ]
        )

    def play(
        self,
        environments: Sequence[gymnasium.Env[Any, Any]],
        scouts: Sequence[gymnasium.Env[Any, Any]],
        **settings: Any,
    ) -> None:
        foresight = Foresight(
            self.predict,
            scouts,
            lambda living: self.depth,
            lambda compared, agreed: self.noted.append((compared, agreed)),
            self.said.append,
        )
        ahead(
            self.act,
            list(environments),
            40,
            foresight=foresight,
            on_rewards=self.rewards.append,
            on_episode=self.episodes.append,
            **settings,
        )


def test_measured_actions_count_up_to_the_first_that_was_not_predicted() -> None:
    """Rows 0 1 2: the second was predicted to be 1 and is 0. It counts, the third does not.

    Then rows 2 3 4 on what 0 0 leads to: all are as predicted; then row 5, the last.
    """
    script = Script(["010011"], ["000011"])
    path, scout = Path(), Path()
    script.play([path], [scout])
    assert script.jobs == [
        [(0, 0, 0b1), (0, 1, 0b10), (0, 2, 0b101)],
        [(0, 2, 0b100), (0, 3, 0b1000), (0, 4, 0b10000)],
        [(0, 5, 0b100001)],
    ]
    assert script.noted == [(2, 1), (3, 3), (1, 1)]
    assert script.rewards == [[1.0, 2.0], [3.0, 4.0, 5.5], [6.5]]
    assert script.episodes == [Episode(40, 22.0, 6)]
    # The scout took 0 1; it was rebuilt by 0 0 and took 0 0; it caught up by 1 and took 1.
    assert (path.resets, path.steps) == (1, 6)
    assert (scout.resets, scout.steps) == (2, 2 + 2 + 2 + 1 + 1)
    assert not script.said


def test_a_chain_whose_last_action_differs_keeps_its_scout() -> None:
    script = Script(["001000"], ["000000"])
    scout = Path()
    script.play([Path()], [scout])
    assert [len(job) for job in script.jobs] == [3, 3]
    assert script.noted == [(3, 2), (3, 3)]
    assert scout.resets == 1


def test_counts_serve_once() -> None:
    """Row 2 of job 1 is discarded; measured again on the same observation, it differs."""

    class Blind(Path):
        def observed(self) -> Any:
            return np.array([self.seed, self.number.bit_length() - 1], dtype=np.float64)

    script = Script(["0100"], ["0011"], again={(0, 2): "0"})
    path = Blind(4)
    script.play([path], [Blind(4)])
    assert script.jobs[0][2] == script.jobs[1][0] == (0, 2, 2)
    assert path.number == 0b10001


def test_the_first_decisions_of_all_come_first_and_each_ends_its_own_chain() -> None:
    """Episode 0 ends after 1 1 as predicted; 1 was predicted to, but continues; 2 is long."""
    ends = [0b111]
    script = Script(["11xx", "1100", "0000"], ["11xx", "1001", "0000"])
    paths, scouts = ([Path(4, ends) for _ in range(3)] for _ in range(2))
    script.play(paths, scouts)
    assert script.jobs == [
        [
            *((0, 0, 0b1), (1, 0, 0b1), (2, 0, 0b1)),
            *((0, 1, 0b11), (1, 1, 0b11), (2, 1, 0b10)),
            (2, 2, 0b100),
        ],
        [(1, 2, 0b110), (2, 3, 0b1000), (1, 3, 0b1100)],
    ]
    assert script.noted == [(2 + 2 + 3, 2 + 1 + 3), (3, 2)]
    assert script.rewards == [[1.5, 2.5, 1.5, 2.0, 1.0, 2.0, 3.0], [3.0, 4.5, 4.0]]
    assert script.episodes == [Episode(40, 4.0, 2), Episode(41, 11.0, 4), Episode(42, 10.0, 4)]


def test_a_chain_ends_at_the_most_steps_and_a_decision_is_held() -> None:
    """Held for two steps, cut after five: decisions of 2, 2 and 1 steps, all in one job."""
    script = Script(["010"], ["010"], depth=9)
    script.play([Path(9)], [Path(9)], hold=2, max_steps=5)
    assert script.jobs == [[(0, 0, 0b1), (0, 1, 0b100), (0, 2, 0b10011)]]
    assert script.rewards == [[1.0 + 2.0, 3.5 + 4.5, 5.0]]
    assert script.episodes == [Episode(40, 16.0, 5)]


def test_frames_are_those_of_the_episode_that_counts() -> None:
    class Filmed(Path):
        def render(self) -> Any:
            return np.full((2, 2, 3), self.number, dtype=np.uint8)

    frames: list[int] = []
    script, filmed = Script(["0100"], ["0011"]), Filmed(4)

    def film(steppers: Sequence[Stepper]) -> None:
        steppers[0].on_step = lambda: frames.append(int(filmed.render()[0, 0, 0]))

    script.play([filmed], [Filmed(4)], on_begin=film)
    assert frames == [0b10, 0b100, 0b1001, 0b10011]


def test_a_scout_that_fails_ends_its_chain_alone() -> None:
    """Only the first scout fails, at 1 0 1; the other episode is still measured ahead."""
    script = Script(["01000", "00000"], ["01000", "00000"])
    script.play([Path(5), Path(5)], [Path(5, fails=[0b101]), Path(5)])
    # It cannot be rebuilt either: a job measures one decision of that episode from then on.
    first, second = (
        [[row[1] for row in job if row[0] == episode] for job in script.jobs] for episode in (0, 1)
    )
    assert first == [[0, 1], [2], [3], [4]]
    assert second == [[0, 1, 2], [3, 4], [], []]
    assert not script.said
    assert script.episodes == [Episode(41, 15.0, 5), Episode(40, 15.5, 5)]


def test_a_failure_counts_where_the_episode_itself_fails() -> None:
    """0 1 fails in any environment. It is predicted, but 0 0 is measured: nothing happens."""
    script = Script(["0100"], ["0000"])
    script.play([Path(4, fails=[0b101])], [Path(4, fails=[0b101])])
    assert script.episodes == [Episode(40, 10.0, 4)]
    assert not script.said
    with pytest.raises(EnvironmentStepError, match=r"seed 40, step 2: .*stuck"):
        Script(["0100"], ["0100"]).play([Path(4, fails=[0b101])], [Path(4, fails=[0b101])])


class Drifting(Path):
    """A path whose `what` differs from its `since`-th step on, counted over all resets."""

    def __init__(self, what: str, since: int):
        super().__init__()
        self.what, self.since = what, since

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = super().step(action)
        if self.steps >= self.since:
            if self.what == "observation":
                observation = np.nextafter(observation, 99.0)
            elif self.what == "reward":
                reward = float(np.nextafter(reward, 99.0))
            else:
                truncated = True
        return observation, reward, terminated, truncated, info


@pytest.mark.parametrize("what", ["observation", "reward", "end"])
@pytest.mark.parametrize("since", [1, 2, 3, 4])
def test_where_an_environment_does_not_repeat_itself_nothing_is_measured_ahead(
    what: str, since: int
) -> None:
    """It differs in its last bit. The actions taken are those of the ordinary closed loop."""
    script = Script(["010010"] * 2, ["000010", "010010"])
    script.play([Path(), Path()], [Path(), Drifting(what, since)])
    assert len(script.said) == 1
    assert script.said[0].endswith("does not repeat itself: steps are no longer measured ahead")
    numbers: list[Episode] = []
    plain = Script(script.predicted, script.measured)
    lockstep(plain.act, [Path(), Path()], 40, on_episode=numbers.append)
    assert sorted(script.episodes, key=lambda e: e.seed) == numbers
    # Every decision counted once, on the observation of its own episode.
    assert sum(len(rewards) for rewards in script.rewards) == 12
    assert sum(compared for compared, _ in script.noted) == 12
    # The second scout steps twice a job: the drift is seen there, and every later job has one row.
    seen_in = 0 if since <= 2 else 1
    assert all(
        sum(row[0] == episode for row in job) <= 1
        for job in script.jobs[seen_in + 1 :]
        for episode in (0, 1)
    )


def test_one_that_resets_otherwise_is_never_run_ahead() -> None:
    class Fresh(Path):
        def reset(self, **settings: Any) -> tuple[Any, dict[str, Any]]:
            super().reset(**settings)
            return np.array([0.0, 1.0]), {}

    script = Script(["010010"], ["000010"])
    script.play([Path()], [Fresh()])
    assert [len(job) for job in script.jobs] == [1] * 6
    assert len(script.said) == 1


def test_without_scouts_a_job_measures_one_decision() -> None:
    script = Script(["010010"], ["000010"])
    script.play([Path()], [])
    assert [len(job) for job in script.jobs] == [1] * 6


@pytest.mark.parametrize(
    "wrap", [NormalizeObservation, NormalizeReward, lambda e: TimeLimit(NormalizeReward(e), 5)]
)
def test_running_statistics_are_refused_in_words(wrap: Callable[[Any], Any]) -> None:
    check_repeatable(TimeLimit(Path(), 5))
    with pytest.raises(OptionError, match=r"keeps running statistics \(Normalize") as refused:
        check_repeatable(wrap(Path()))
    assert "Use speculate 1." in str(refused.value)
