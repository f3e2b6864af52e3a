"""The cost of a run: IBM's estimate by hand, and batches split at IBM's limit per job."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qcompile.execution import Workload, portions, qpu_seconds
from qcompile.mitigation import calibration_workload

LIMIT = 10_000_000
"""IBM's, "Job limits": executions of one job."""


def test_exact_expectations_take_no_executions() -> None:
    assert Workload.of_batch(3, 2, 0) == Workload(1, 0)


def test_seconds_by_hand() -> None:
    assert qpu_seconds(1, 0) == 2.0
    assert qpu_seconds(3, 100_000) == pytest.approx(6 + 35)


@given(rows=st.integers(1, 60), rounds=st.integers(1, 12), shots=st.integers(1, LIMIT))
def test_every_round_of_every_row_lies_in_one_job_that_is_not_too_large(
    rows: int, rounds: int, shots: int
) -> None:
    jobs = portions([rows] * rounds, shots)
    places = Counter((part.pub, row) for job in jobs for part in job for row in part.rows)
    assert places == {(turn, row): 1 for row in range(rows) for turn in range(rounds)}
    sizes = [shots * sum(len(part.rows) for part in job) for job in jobs]
    assert all(size + shots > LIMIT for size in sizes[:-1]), "each but the last is full"
    assert max(sizes) <= LIMIT
    assert min(sizes) > 0
    if rows * rounds * shots <= LIMIT:
        assert len(jobs) == 1
    load = Workload.of_batch(rows, rounds, shots)
    assert (load.jobs, load.executions) == (len(jobs), sum(sizes))


@pytest.mark.parametrize(
    ("rows", "rounds", "shots", "sizes"),
    [
        (10, 1, 1_000_000, [10_000_000]),
        (11, 1, 1_000_000, [10_000_000, 1_000_000]),
        (3, 2, 2_500_000, [10_000_000, 5_000_000]),
        (1, 3, 4_000_000, [8_000_000, 4_000_000]),
        (2, 3, 4_000_000, [8_000_000] * 3),
        (2, 1, 10_000_000, [10_000_000] * 2),
    ],
)
def test_jobs_by_hand(rows: int, rounds: int, shots: int, sizes: list[int]) -> None:
    jobs = portions([rows] * rounds, shots)
    assert [shots * sum(len(part.rows) for part in job) for job in jobs] == sizes


def test_pubs_of_several_rows_by_hand() -> None:
    found = portions([3, 0, 1, 2], 4_000_000)
    expected = [[(0, [0, 1])], [(0, [2]), (2, [0])], [(3, [0, 1])]]
    assert [[(part.pub, list(part.rows)) for part in job] for job in found] == expected
    assert portions([0], 10) == []
    assert Workload.of_batch(7, 2, 0) == Workload(1, 0), "exact"


def test_workloads_add_up() -> None:
    first, second = Workload(1, 100), Workload(2, 50)
    assert first + second == Workload(3, 150)
    assert second * 3 == Workload(6, 150)
    assert Workload() + first == first
    assert Workload(2, 10_000).qpu_seconds == pytest.approx(7.5)


@pytest.mark.parametrize(
    ("load", "seconds"),
    [
        (Workload.of_batch(1, 24, 8192) * 300, 21_000),
        (Workload.of_batch(1, 1, 8192) * 300, 1_500),
        (calibration_workload(24, 8192, ["response"], 6), 20),
    ],
    ids=["24 circuits a step", "one circuit a step", "response calibration"],
)
def test_the_figures_of_the_design(load: Workload, seconds: float) -> None:
    """An episode of LunarLander, 300 steps of 8192 shots; they are rounded to 5 %."""
    assert load.qpu_seconds == pytest.approx(seconds, rel=0.05)


@pytest.mark.parametrize(("qubits", "patterns"), [(1, 2), (2, 4), (5, 8), (27, 12)])
def test_a_readout_calibration_by_hand(qubits: int, patterns: int) -> None:
    """All 0, all 1, and two patterns for each binary digit of a qubit's number: one job."""
    assert calibration_workload(qubits, 100, ["readout"]) == Workload(1, patterns * 100)
    both = calibration_workload(qubits, 100, ["readout", "response"], 6)
    assert both == Workload(2, (patterns + 6) * 100)
