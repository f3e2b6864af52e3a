"""The recommended settings, for scripted rewards and chains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from qcompile.deploy.settings import RunSettings
from qcompile.errors import OptionError
from qcompile.execution import Workload, load_backend
from qcompile.planning import search as searching
from qcompile.planning.chains import Chains
from qcompile.planning.search import Goal, SearchResult, search
from qcompile.planning.share import Baseline
from qcompile.planning.simulation import Simulated
from qcompile.policy import Policy, load_circuits

LIMA = load_backend("fake_lima")
POLICY = load_circuits("cartpole_1q")
Search = Callable[..., SearchResult]


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> Search:
    """A search in which random actions earn 0, the ideal policy 100, and each number of shots this.

    Each episode has this many decisions, all predicted correctly, one row each.
    """

    def run(
        rewards: dict[int, float],
        within: float = 600,
        decisions: list[int] | None = None,
        policies: list[Policy] | None = None,
        **options: Any,
    ) -> SearchResult:
        lengths = np.array(decisions or [8])

        def simulate(policy: Policy, backend: Any, settings: RunSettings, episodes: int) -> Any:
            assert settings.shots is not None
            own = np.resize(lengths, episodes)
            reward = rewards.get(settings.shots, 0.0)
            return Simulated(
                LIMA.device,
                settings,
                np.full(episodes, reward + (10 if policy.name == "better" else 0)),
                own,
                Chains(np.arange(own.max()) < own[:, None], own),
                1,
                Workload(1, 1000),
            )

        monkeypatch.setattr(searching, "simulate", simulate)
        monkeypatch.setattr(searching, "random_rewards", lambda *_: np.zeros(100))
        monkeypatch.setattr(searching, "ideal_rewards", lambda p, s, n: np.full(n, 100.0))
        settings = RunSettings().resolved(LIMA.device)
        return search(policies or [POLICY], LIMA, Goal(settings, 10, within, **options))

    return run


def test_the_cheapest_that_keeps_enough(scripted: Search) -> None:
    found = scripted({256: 100, 128: 99, 64: 97, 32: 96.9})
    assert found.recommended is not None
    assert found.recommended.settings.shots == 64
    assert [point.settings.shots for point in found.frontier] == [32, 64, 128, 256]
    assert found.recommended.share == pytest.approx(0.97)


def test_more_shots_where_256_do_not_keep_enough(scripted: Search) -> None:
    found = scripted({256: 90, 512: 95, 1024: 98})
    assert found.recommended is not None
    assert found.recommended.settings.shots == 1024


def test_fewer_are_not_tried_where_one_failed(scripted: Search) -> None:
    found = scripted({256: 100, 192: 60, 128: 50, 64: 100})
    assert {point.settings.shots for point in found.points} == {256, 192, 128}


@pytest.mark.parametrize(
    ("rewards", "shots"),
    [
        ({256: 100, 128: 100, 96: 98, 64: 50}, 96),
        ({256: 100, 128: 100, 96: 96, 64: 50}, 128),
        ({256: 50, 384: 97, 512: 100}, 384),
    ],
)
def test_between_the_last_two_one_more_is_tried(
    scripted: Search, rewards: dict[int, float], shots: int
) -> None:
    found = scripted(rewards)
    assert found.recommended is not None
    assert found.recommended.settings.shots == shots


def test_what_keeps_enough_must_fit(scripted: Search) -> None:
    """Calibration 2.35 s; 8 rows of 10 episodes in the 5 places of lima: 64 shots are at least
    2 s and 13 executions of the program for each decision."""
    found = scripted({256: 100, 128: 99, 64: 97}, within=3)
    assert found.recommended is None
    nearest = found.nearest()
    assert nearest["keep"] is None
    assert nearest["within"] == np.ceil(
        min(p.most_seconds for p in found.points if p.share >= 0.97)
    )
    again = scripted({256: 100, 128: 99, 64: 97}, within=nearest["within"])
    assert again.recommended is not None


def test_fewer_episodes_fit_as_nearest_says(scripted: Search) -> None:
    given = {"shots": 8192, "copies": 1, "split": False, "speculate": 8}
    found = scripted({8192: 100}, within=51, fixed=given)
    # 2.35 s of calibration; n episodes are a job of 2 s and 8 n 8192 0.00035 = 22.94 n s
    assert found.recommended is None
    assert found.nearest()["episodes"] == 2


@pytest.mark.parametrize("within", [20, 600])
def test_an_episode_is_cut_where_that_saves_much(scripted: Search, within: float) -> None:
    """Of 200 episodes four are long: a cut at 8 steps touches 2 % of them."""
    long = [*[8] * 49, 800]
    table = dict.fromkeys((8, 16, 32, 64, 128, 256), 100.0)
    found = scripted(table, within=within, decisions=long)
    assert found.recommended is not None
    assert found.recommended.cut == 8
    assert found.recommended.mean_reward == 100  # of whole episodes
    assert found.recommended in found.frontier
    assert scripted(table, 20, decisions=[*[8] * 30, 800]).recommended is None  # 3 %


def test_an_episode_is_not_cut_where_that_saves_little(scripted: Search) -> None:
    """Sixteen steps that are always predicted take a job, as eight do; and few executions more."""
    table = dict.fromkeys((8, 16, 32, 64, 128, 256), 100.0)
    chosen = scripted(table, within=600, decisions=[*[8] * 49, 16]).recommended
    assert chosen is not None
    assert chosen.cut is None
    assert chosen.shortened() is not None


def test_what_is_given_is_kept(scripted: Search) -> None:
    given = {"shots": 100, "copies": 2, "split": True, "speculate": 4, "max_steps": 7}
    found = scripted({100: 100}, fixed=given | {"calibration_shots": 77})
    assert found.recommended is not None
    settings = found.recommended.settings
    assert {name: getattr(settings, name) for name in given} == given
    assert settings.calibration_shots == 77


def test_the_better_of_two_policies_at_the_same_price(scripted: Search) -> None:
    better = replace(POLICY, name="better")
    found = scripted({256: 88, 128: 50}, policies=[POLICY, better])
    assert found.recommended is not None
    assert found.recommended.policy is better


def test_policies_of_two_environments_are_refused(scripted: Search) -> None:
    with pytest.raises(OptionError, match=r"Acrobot-v1, CartPole-v1"):
        scripted({}, policies=[POLICY, load_circuits("acrobot")])


def test_a_share_by_hand() -> None:
    baseline = Baseline(np.array([0.0, 2.0, 4.0]), np.array([100.0, 102.0, 104.0]))
    assert baseline.share(np.array([51.0, 53.0, 52.0])) == pytest.approx(0.5)
    assert baseline.share_95(baseline.ideal) == pytest.approx((1.0, 1.0))
    low, high = baseline.share_95(np.array([90.0, 102.0, 99.0]))
    assert low < 0.95 < high  # (97 - 2) / 100


@pytest.mark.parametrize("ideal", [[1.0, 3.0], [0.0, 0.0], [2.1, 2.3]])
def test_a_policy_like_random_actions_keeps_nothing(ideal: list[float]) -> None:
    with pytest.raises(OptionError, match="there is nothing to keep"):
        Baseline(np.array([0.0, 4.0]), np.array(ideal))


def test_copies_that_are_given_have_a_shot_or_an_episode_each(scripted: Search) -> None:
    """40 copies, 10 episodes: rows are split, over 64 shots at least."""
    rewards = dict.fromkeys((8, 16, 32, 64, 128, 256), 100.0)
    for split in ({}, {"split": True}):
        found = scripted(rewards, fixed={"copies": 40, **split})
        assert {(p.settings.copies, p.settings.split) for p in found.points} == {(40, True)}
        assert min(p.settings.shots or 0 for p in found.points) == 64
    with pytest.raises(OptionError, match="40 copies are more than the 10 episodes"):
        scripted(rewards, fixed={"copies": 40, "split": False})
    with pytest.raises(OptionError, match="40 copies are more than the 10 episodes"):
        scripted(rewards, fixed={"copies": 40, "shots": 8})
