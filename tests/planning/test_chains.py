"""Rows and jobs of speculation, by hand, from where predictions are right."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.arrays import IntArray
from qcompile.deploy.depth import Depth
from qcompile.execution import Workload
from qcompile.execution.cost import job_counts, portions
from qcompile.planning.chains import Chains
from qcompile.planning.cost import Packing, Price, at_sub_jobs

FIRST, SECOND = "1101111", "011"
"""The decisions of two episodes: 0 where the prediction was wrong."""


def chains(*episodes: str) -> Chains:
    width = max(map(len, episodes))
    agree = [[mark == "1" for mark in episode.ljust(width, "0")] for episode in episodes]
    return Chains(np.array(agree), np.array([len(episode) for episode in episodes]))


@pytest.mark.parametrize(
    ("depth", "rows"),
    [
        (1, [[1, 1], [1, 1], [1, 1], [1, 0], [1, 0], [1, 0], [1, 0]]),
        # the first: 1 1 | 0 | 1 1 | 1 1, and one row behind the 0; the second: 0 | 1 1
        (2, [[2, 2], [2, 2], [2, 0], [2, 0]]),
        # 1 1 0 | 1 1 1 1, the fourth row of the first job lies behind the 0; 0 | 1 1, two of the
        # first job's three lie behind it
        (4, [[4, 3], [4, 2]]),
        (64, [[7, 3], [4, 2]]),
    ],
)
def test_rows_of_every_job_by_hand(depth: int, rows: list[list[int]]) -> None:
    np.testing.assert_array_equal(chains(FIRST, SECOND).rows(depth), rows)


def test_a_cut_ends_an_episode_earlier() -> None:
    np.testing.assert_array_equal(chains(FIRST, SECOND).cut(4).rows(64), [[4, 3], [1, 2]])


def test_auto_is_told_of_each_job_what_counted_and_what_was_right() -> None:
    told: list[tuple[int, int]] = []

    class Told(Depth):
        def next(self, load: Workload) -> int:
            return {0: 4, 1: 1}.get(len(told), 2)

        def note(self, compared: int, agreed: int) -> None:
            told.append((compared, agreed))

    rows = chains(FIRST, SECOND).rows_of(
        Told("auto"), lambda living: Workload(1, int(living.sum()))
    )
    # depth 4: 1 1 0 and 0 count; depth 1: 1 and 1; then 2 at a time: 1 1 and 1; 1
    np.testing.assert_array_equal(rows, [[4, 3], [1, 1], [2, 1], [1, 0]])
    assert told == [(4, 2), (2, 2), (3, 3), (1, 1)]


@pytest.mark.parametrize(
    ("packing", "programs", "load"),
    [
        # two rounds of 10 shots each for every row
        (Packing(2, 10), [7, 2], Workload(2, 9 * 20)),
        # the fullest of two copies: episodes 0 and 2 share one
        (Packing(1, 10, 2), [5, 2], Workload(2, 70)),
        (Packing(1, 4), [7, 2], Workload(2, 36)),
    ],
)
def test_executions_by_hand(packing: Packing, programs: list[int], load: Workload) -> None:
    rows: IntArray = np.array([[4, 2, 1], [2, 0, 0]])
    assert packing.programs(rows).tolist() == programs
    assert packing.load(rows) == load


@pytest.mark.parametrize(("rounds", "shots"), [(1, 8192), (5, 8192), (3, 4_000_000), (1, 10**7)])
def test_jobs_are_those_of_the_portions(rounds: int, shots: int) -> None:
    rows = np.array([1, 2, 3, 250, 5000])
    expected = [len(portions([count] * rounds, shots)) for count in rows.tolist()]
    assert job_counts(rows * rounds, shots).tolist() == expected


def test_the_price_counts_the_calibration() -> None:
    price = Price(chains(*[FIRST] * 5), 2, Packing(1, 100), 4, Workload(1, 1000))
    # four rows to the wrong one, which counts third, and the four that are left; of two episodes
    assert price.load == Workload(3, 1000 + 100 * 16)
    assert price.seconds == pytest.approx(3 * 2 + 0.00035 * 2600)
    assert at_sub_jobs(price.load) == pytest.approx(3 * 8 + 0.00035 * 2600)


def test_runs_of_equal_episodes_are_equal() -> None:
    price = Price(chains(*[FIRST] * 9), 5, Packing(1, 100), 2, Workload())
    assert price.seconds_80 == pytest.approx((4 * 2 + 0.00035 * 4000,) * 2)
    assert price.seconds == pytest.approx(4 * 2 + 0.00035 * 4000)


def test_a_run_is_one_of_episodes_drawn_from_all() -> None:
    """One episode in a hundred needs 50 jobs, the others 1: a run of n has it with 1 - .99^n."""
    rare = chains("1" * 50, *["1"] * 99)
    few = Price(rare, 3, Packing(1, 1), 1, Workload())
    assert few.seconds_80 == pytest.approx((2.0, 2.0), abs=0.01)  # 3 %
    many = Price(rare, 30, Packing(1, 1), 1, Workload())
    assert many.seconds_80 == pytest.approx((2.0, 100.0), abs=0.1)  # 26 %
    share, spread = 1 - 0.99**30, 98 * (0.26 * 0.74 / 100) ** 0.5
    assert many.seconds == pytest.approx(2 + 98 * share, abs=3 * spread)
