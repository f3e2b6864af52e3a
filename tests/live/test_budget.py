"""The guard, with sums made by hand: a job of 10,000 executions is estimated at 5.5 s."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from qcompile.errors import BudgetError
from qcompile.live.budget import Budget
from qcompile.live.journal import Journal

ESTIMATE_S = 5.5
ONES = np.zeros((1, 1), dtype=np.int64)


@pytest.fixture
def journal() -> Journal:
    return Journal.create(Path("runs"), "run", "cart", {}, 20.0)


def done(journal: Journal, usage_s: float | None, number: int = 0) -> None:
    journal.note_done(journal.intend(number, "d", 10_000), ONES, usage_s)


def test_nothing_is_spent_by_a_new_run(journal: Journal) -> None:
    budget = Budget(journal)
    assert budget.spent_s() == budget.charged_s() == 0
    assert budget.limit_s == 20
    assert budget.expected_s(10_000) == pytest.approx(ESTIMATE_S)


def test_what_is_charged_counts_and_estimates_else(journal: Journal) -> None:
    budget = Budget(journal)
    done(journal, 4.0)
    assert (budget.charged_s(), budget.spent_s()) == (4.0, 4.0)
    done(journal, None, 1)
    assert (budget.charged_s(), budget.spent_s()) == (4.0, pytest.approx(4 + ESTIMATE_S))
    journal.note_sent(journal.intend(2, "d", 10_000), "job-a")
    assert budget.spent_s() == pytest.approx(4 + 2 * ESTIMATE_S)
    journal.intend(3, "d", 10_000)
    assert budget.spent_s() == pytest.approx(4 + 3 * ESTIMATE_S)


def test_a_job_that_failed_counts_with_its_charge(journal: Journal) -> None:
    journal.note_failed(journal.intend(0, "d", 10_000), "no", 0.0)
    journal.note_failed(journal.intend(0, "d", 10_000), "no", 3.0)
    assert Budget(journal).spent_s() == 3.0


def test_the_worst_ratio_of_charge_to_estimate_is_expected_of_the_next(journal: Journal) -> None:
    budget = Budget(journal)
    done(journal, 2.75)  # half of the estimate: no reason to expect less
    assert budget.expected_s(10_000) == pytest.approx(ESTIMATE_S)
    done(journal, 11.0, 1)
    done(journal, 8.25, 2)
    assert budget.expected_s(10_000) == pytest.approx(2 * ESTIMATE_S)
    done(journal, None, 3)
    assert budget.spent_s() == pytest.approx(2.75 + 11 + 8.25 + 11)


def test_a_failed_job_says_nothing_about_the_ratio(journal: Journal) -> None:
    journal.note_failed(journal.intend(0, "d", 10_000), "no", 55.0)
    assert Budget(journal).expected_s(10_000) == pytest.approx(ESTIMATE_S)


def test_a_job_that_fits_exactly_may_be_sent_and_a_larger_one_not(journal: Journal) -> None:
    budget = Budget(journal)
    journal.allow(2 * ESTIMATE_S + 1e-9)
    done(journal, ESTIMATE_S)
    budget.check(10_000)
    with pytest.raises(BudgetError):
        budget.check(10_001)


def test_the_refusal_says_where_the_run_stands_and_what_goes_on(journal: Journal) -> None:
    done(journal, 15.0)
    journal.note_actions(0, np.zeros((1, 1)), np.zeros(1, np.intp))
    with pytest.raises(BudgetError) as caught:
        Budget(journal).check(10_000)
    assert str(caught.value) == (
        "The limit of 20 QPU seconds would be passed: 15.0 s are spent, the next job takes about "
        "15.0 s.\n"
        "  1 jobs are done, 1 steps are played; all of it is kept.\n"
        f"  `qcompile resume {journal.id} --max-qpu-seconds S` goes on with more."
    )


@pytest.mark.parametrize(
    ("limit_s", "charged_s", "allowed_s"),
    [(20.0, 6.0, 14), (20.9, 6.0, 14), (12.0, 6.0, 6), (11.9, 6.0, 6), (30.0, 11.0, 19)],
)
def test_a_sent_job_may_take_what_all_others_leave(
    journal: Journal, limit_s: float, charged_s: float, allowed_s: int
) -> None:
    """In whole seconds, and the 5.5 s that it is expected to take in any case."""
    journal.allow(limit_s)
    done(journal, charged_s)
    made = journal.intend(1, "d", 10_000)
    assert Budget(journal).allowance_s(made.executions) == allowed_s
