"""The guard, with sums made by hand: a job of 10,000 executions is estimated at 5.5 s."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qcompile.errors import BudgetError
from qcompile.live.budget import Budget
from qcompile.live.journal import Journal
from qcompile.live.records import Submission

ESTIMATE_S = 5.5
ONES = np.zeros((1, 1), dtype=np.int64)


@pytest.fixture
def journal() -> Journal:
    return new()


def new() -> Journal:
    return Journal.create(Path("runs"), "run", "cart", {}, {}, 20.0)


def sent(journal: Journal, cap_s: int, number: int = 0) -> Submission:
    made = journal.note_sending(journal.intend(number, "d", 10_000), cap_s)
    journal.note_sent(made, f"job-{number}")
    return made


def done(journal: Journal, charged_s: float | None, number: int = 0, cap_s: int = 15) -> None:
    journal.note_done(sent(journal, cap_s, number), ONES, charged_s)


def cap(journal: Journal, number: int = 9, executions: int = 10_000) -> int:
    return Budget(journal).cap_s(journal.intend(number, "d", executions))


def test_nothing_is_spent_by_a_new_run(journal: Journal) -> None:
    budget = Budget(journal)
    assert budget.charged_s() == 0
    assert budget.limit_s == 20
    assert budget.expected_s(10_000) == pytest.approx(ESTIMATE_S)
    assert cap(journal) == 20


def test_what_is_charged_counts_and_caps_else(journal: Journal) -> None:
    """A job of which IBM has said nothing may cost what it was capped at, and not less."""
    budget = Budget(journal)
    journal.allow(40.0)
    done(journal, 4.0)
    assert (budget.charged_s(), cap(journal)) == (4.0, 32)  # four times 5.5 s and ten, at most
    done(journal, None, 1, cap_s=9)
    assert (budget.charged_s(), cap(journal)) == (4.0, 40 - 4 - 9)
    sent(journal, 7, 2)
    assert (budget.charged_s(), cap(journal)) == (4.0, 40 - 4 - 9 - 7)
    journal.note_sending(journal.intend(3, "d", 10_000), 5)
    assert (budget.charged_s(), cap(journal)) == (4.0, 40 - 4 - 9 - 7 - 5)
    journal.note_charge("job-1", 2.5)
    assert (budget.charged_s(), cap(journal)) == (6.5, 40 - 7 - 7 - 5)


def test_what_was_never_sent_costs_nothing(journal: Journal) -> None:
    journal.intend(0, "d", 10_000)
    journal.intend(1, "d", 10_000)
    assert cap(journal) == 20


def test_a_submission_does_not_count_against_itself(journal: Journal) -> None:
    """Sent again after no answer, it has its own seconds still."""
    made = journal.note_sending(journal.intend(0, "d", 10_000), 20)
    assert Budget(journal).cap_s(made) == 20
    journal.note_failed(made, "no", 0.0)
    assert Budget(journal).cap_s(journal.intend(0, "d", 10_000)) == 20


def test_the_second_job_of_a_submission_counts_with_its_cap_then_its_charge(
    journal: Journal,
) -> None:
    made = sent(journal, 6)
    journal.note_done(made, ONES, 2.0)
    journal.note_extra(made, "job-x")
    assert Budget(journal).charged_s() == 2.0
    assert cap(journal) == 20 - 2 - 6
    journal.note_charge("job-x", 1.5)
    assert Budget(journal).charged_s() == 3.5
    assert cap(journal) == 16  # of 16.5, and of the 32 that it might take


def test_a_job_that_failed_counts_with_its_charge(journal: Journal) -> None:
    for charged_s in (0.0, 3.0):
        journal.note_failed(sent(journal, 15), "no", charged_s)
    assert Budget(journal).charged_s() == 3.0
    assert cap(journal) == 17


@pytest.mark.parametrize("ended", ["done", "failed"])
def test_the_worst_ratio_of_charge_to_estimate_is_expected_of_the_next(
    journal: Journal, ended: str
) -> None:
    """Of whatever has a charge: a job that was cut off took at least so long."""
    budget = Budget(journal)
    journal.allow(1000.0)

    def end(number: int, charged_s: float | None) -> None:
        made = sent(journal, 100, number)
        if ended == "done":
            journal.note_done(made, ONES, charged_s)
        else:
            journal.note_failed(made, "no", charged_s)

    end(0, 2.75)  # half of the estimate: no reason to expect less
    assert budget.expected_s(10_000) == pytest.approx(ESTIMATE_S)
    assert cap(journal) == 32
    end(1, 11.0)
    end(2, 8.25)
    end(3, None)
    assert budget.expected_s(10_000) == pytest.approx(2 * ESTIMATE_S)
    assert budget.expected_s(20_000) == pytest.approx(2 * 9.0)
    assert cap(journal) == 54


def test_a_job_that_fits_exactly_may_be_sent_and_a_larger_one_not(journal: Journal) -> None:
    """6 s are left: 2 s and 11,428 executions of 0.35 ms are 5.9998 s, one more is 6.00015."""
    done(journal, 4.0)
    journal.allow(10.0)
    assert cap(journal, 1, 11_428) == 6
    with pytest.raises(BudgetError):
        cap(journal, 2, 11_429)


def test_the_refusal_says_what_is_spent_and_what_the_next_job_takes(journal: Journal) -> None:
    done(journal, 11.0)
    done(journal, None, 1, cap_s=4)
    with pytest.raises(BudgetError) as caught:
        cap(journal)
    assert str(caught.value) == (
        "The limit of 20 QPU seconds would be passed: 15.0 s are spent or may yet be charged, the "
        "next job takes about 11.0 s."
    )


@pytest.mark.parametrize(
    ("limit_s", "charged_s", "cap_s"),
    [(20.0, 6.0, 14), (20.9, 6.0, 14), (12.0, 6.0, 6), (12.9, 6.0, 6), (30.0, 6.0, 24)],
)
def test_a_job_may_take_what_all_others_leave_in_whole_seconds(
    journal: Journal, limit_s: float, charged_s: float, cap_s: int
) -> None:
    journal.allow(limit_s)
    done(journal, charged_s)
    assert cap(journal) == cap_s
    assert isinstance(cap(journal), int)


def test_less_than_the_expected_is_refused_though_it_would_be_enough_in_parts(
    journal: Journal,
) -> None:
    """5.9 s are left, of which IBM cuts off at 5; 5.5 are expected."""
    journal.allow(11.4)
    done(journal, 5.5)
    with pytest.raises(BudgetError, match=r"the next job takes about 5\.5 s"):
        cap(journal)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    limit_s=st.floats(3.0, 60.0),
    jobs=st.lists(
        st.tuples(st.integers(1, 20_000), st.floats(0.1, 6.0), st.booleans()), max_size=8
    ),
)
def test_whatever_ibm_charges_below_the_caps_the_limit_holds(
    limit_s: float, jobs: list[tuple[int, float, bool]]
) -> None:
    """IBM charges what a job takes, or its cap; of some it says so long after all are sent."""
    total, late = 0.0, {}
    with new() as journal:
        journal.allow(limit_s)
        for number, (executions, factor, says) in enumerate(jobs):
            made = journal.intend(number, "d", executions)
            try:
                cap_s = Budget(journal).cap_s(made)
            except BudgetError:
                continue
            charged_s = min(factor * (2 + 0.00035 * executions), cap_s)
            journal.note_sent(journal.note_sending(made, cap_s), f"job-{number}")
            journal.note_done(made, ONES, charged_s if says else None)
            late |= {} if says else {f"job-{number}": charged_s}
            total += charged_s
        assert total <= limit_s
        for job_id, charged_s in late.items():
            journal.note_charge(job_id, charged_s)
        assert Budget(journal).charged_s() == pytest.approx(total)
