"""On a machine whose counts are fresh: the law of an episode, against a closed form.

Measuring ahead must keep it, and the same tests must catch deliberately broken loops. `make
speculation` does the same with a thousand landers.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium
import pytest
from coins import (
    SHOTS,
    STEPS,
    Coins,
    Remembering,
    chance,
    coins,
    law,
    measured_again,
    surprise,
)
from fresh import FreshExecutor
from scipy import stats

from qcompile.deploy import ahead
from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.device import load_device

DEVICE, EPISODES = "fake_lima", 300
LIKELY, CAUGHT = 1e-3, 1e-6


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    gymnasium.register("Coins-v0", Coins)
    yield
    del gymnasium.registry["Coins-v0"]


def played(depth: Any, executor: FreshExecutor, seed: int, **settings: Any) -> Any:
    player = Deployment(
        coins(**settings), executor, shots=SHOTS, mitigation="none", speculate=depth, seed=seed
    )
    return play(player, EPISODES)


def machine(seed: int) -> FreshExecutor:
    return FreshExecutor(load_device(DEVICE), seed)


@pytest.mark.parametrize(("depth", "seed"), [(1, 0), (8, 10_000), ("auto", 20_000)])
def test_the_law_is_that_of_the_closed_loop(depth: Any, seed: int) -> None:
    run = played(depth, machine(seed + 1), seed)
    assert surprise(run.rewards, law(chance(DEVICE))) > LIKELY
    assert run.measured_rows > 1.2 * run.decisions or depth == 1


def test_two_samples_do_not_differ() -> None:
    runs = [played(depth, machine(seed), seed) for depth, seed in ((1, 30_000), (6, 40_000))]
    for values in (
        [run.rewards for run in runs],
        [[episode.length for episode in run.episodes] for run in runs],
    ):
        assert stats.ks_2samp(*values).pvalue > LIKELY
        assert stats.mannwhitneyu(*values).pvalue > LIKELY


def test_counts_that_serve_again_are_caught() -> None:
    run = played(8, Remembering(load_device(DEVICE), 1), 0)
    assert surprise(run.rewards, law(chance(DEVICE))) < CAUGHT


def test_a_row_that_is_measured_again_where_it_surprises_is_caught(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = played(8, machine(1), 0).rewards
    monkeypatch.setattr(ahead._Pair, "accept", measured_again)
    broken = played(8, machine(1), 0).rewards
    assert surprise(broken, law(chance(DEVICE))) < CAUGHT
    assert stats.ks_2samp(whole, broken).pvalue < CAUGHT
    assert stats.mannwhitneyu(whole, broken).pvalue < CAUGHT


def test_episodes_that_finish_first_are_others() -> None:
    """All have 24 steps: those measured as predicted end first. No mean is reported."""
    finished: list[float] = []

    def note(episode: Any) -> None:
        finished.append(episode.reward)
        if len(finished) == EPISODES // 4:
            raise KeyboardInterrupt

    policy = coins(misses=STEPS + 1)
    settings: dict[str, Any] = {"shots": SHOTS, "mitigation": "none", "speculate": 8}
    run = play(Deployment(policy, machine(1), **settings), EPISODES, on_episode=note)
    assert surprise_of_mean(run) < 1e-4
    assert run.summary()["mean_reward"] is None
    assert run.decisions == run.env_steps < run.measured_rows
    whole = play(Deployment(policy, machine(2), **settings), EPISODES)
    assert surprise_of_mean(whole) > LIKELY


def surprise_of_mean(run: Any) -> float:
    """The p-value of the ones among all actions of the finished episodes."""
    ones, steps = int(run.rewards.sum()), STEPS * len(run.rewards)
    return float(stats.binomtest(ones, steps, chance(DEVICE)).pvalue)
