"""The speculation depth: from hand-computed costs, and from earlier jobs only."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.deploy.depth import Depth, accepted, deepest_that_pays, seconds
from qcompile.execution import Workload
from qcompile.limits import MOST_AHEAD


def test_a_fixed_depth_stays() -> None:
    depth = Depth(7)
    depth.note(1000, 3)
    assert depth.next(Workload(1, 10**6)) == 7


def test_the_first_row_counts_and_each_further_one_if_all_before_agreed() -> None:
    # 1 + 1/2 + 1/4 = 7/4
    np.testing.assert_allclose(accepted(0.5, np.array([1, 2, 3])), [1.0, 1.5, 1.75])
    np.testing.assert_allclose(accepted(1.0, np.array([1, 5])), [1.0, 5.0])


def test_seconds_are_those_of_ibm_with_a_job_more_where_one_is_too_large() -> None:
    # 2 s a job, 0.00035 s an execution; a job takes 10 million executions
    load = Workload(1, 4_000_000)
    expected = [2 + 1400, 2 + 2800, 4 + 4200]
    np.testing.assert_allclose(seconds(load, np.array([1, 2, 3])), expected)


@pytest.mark.parametrize(
    ("agreement", "executions", "depth"),
    [
        # executions of 2.1 s: 1 / 4.1 = 0.244, 1.5 / 6.2 = 0.242, 1.75 / 8.3
        (0.5, 6000, 1),
        # 0.525 s: 1 / 2.525 = 0.396, 1.5 / 3.05 = 0.492, 1.75 / 3.575 = 0.490
        (0.5, 1500, 2),
        # 0.105 s: 1.75 / 2.315 = 0.756, 1.875 / 2.42 = 0.775, 1.9375 / 2.525 = 0.767
        (0.5, 300, 4),
        (1.0, 1000, MOST_AHEAD),
        (0.0, 1000, 1),
    ],
)
def test_the_depth_with_most_decisions_a_second(
    agreement: float, executions: int, depth: int
) -> None:
    assert deepest_that_pays(agreement, Workload(1, executions)) == depth


def test_auto_follows_earlier_jobs_alone() -> None:
    load = Workload(1, 300)
    sure, doubtful = Depth("auto"), Depth("auto")
    assert sure.next(load) == doubtful.next(load) > 1
    sure.note(1000, 1000)
    doubtful.note(1000, 500)
    assert doubtful.next(load) == 4
    assert sure.next(load) == MOST_AHEAD
