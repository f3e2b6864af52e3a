"""The guard, with sums computed by hand: a job of 10,000 executions is estimated at 5.5 s."""

from __future__ import annotations

import math
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


@pytest.fixture
def journal() -> Journal:
    return new()


def new() -> Journal:
    return Journal.create(Path("runs"), "run", "cart", {}, {}, 20.0)


def sent(journal: Journal, cap_s: int, number: int = 0, job_id: str | None = None) -> Submission:
    made = journal.note_sending(journal.intend(number, "d", 10_000), cap_s)
    journal.note_sent(made, job_id or f"job-{number}")
    return made


def charge(journal: Journal, job_id: str, charged_s: float) -> None:
    found = journal.charges.of_job(job_id)
    assert found is not None
    journal.charges.settle(found, charged_s)


def done(journal: Journal, charged_s: float | None, number: int = 0, cap_s: int = 15) -> None:
    journal.note_done(sent(journal, cap_s, number), [])
    if charged_s is not None:
        charge(journal, f"job-{number}", charged_s)


def cap(journal: Journal, executions: int = 10_000) -> int:
    return Budget(journal).cap_s(executions)


def told(journal: Journal) -> tuple[float, float]:
    """The reported figures: the upper bound, and the settled part."""
    return journal.charges.upper_s, journal.charges.settled_s


def test_nothing_is_spent_by_a_new_run(journal: Journal) -> None:
    budget = Budget(journal)
    assert told(journal) == (0, 0)
    assert budget.limit_s == 20
    assert budget.expected_s(10_000) == pytest.approx(ESTIMATE_S)
    assert cap(journal) == 20


def test_what_is_charged_counts_and_caps_else(journal: Journal) -> None:
    """A job without a reported charge counts with its cap, and not less."""
    journal.allow(40.0)
    done(journal, 4.0)
    assert (told(journal), cap(journal)) == ((4, 4), 32)  # four times 5.5 s and ten, at most
    done(journal, None, 1, cap_s=9)
    assert (told(journal), cap(journal)) == ((4 + 9, 4), 40 - 4 - 9)
    sent(journal, 7, 2)
    assert (told(journal), cap(journal)) == ((4 + 9 + 7, 4), 40 - 4 - 9 - 7)
    journal.note_sending(journal.intend(3, "d", 10_000), 5)
    assert (told(journal), cap(journal)) == ((4 + 9 + 7 + 5, 4), 40 - 4 - 9 - 7 - 5)
    charge(journal, "job-1", 2.5)
    assert (told(journal), cap(journal)) == ((6.5 + 7 + 5, 6.5), 40 - 7 - 7 - 5)


def test_what_was_never_sent_costs_nothing(journal: Journal) -> None:
    journal.intend(0, "d", 10_000)
    journal.intend(1, "d", 10_000)
    assert (told(journal), cap(journal)) == ((0, 0), 20)


def test_each_sending_without_an_answer_counts_with_its_own_cap(journal: Journal) -> None:
    """IBM may have accepted any of them, and all."""
    made = journal.intend(0, "d", 10_000)
    journal.note_sending(made, 8)
    assert cap(journal) == 12
    journal.note_sending(made, 6)
    assert (told(journal), cap(journal)) == ((14, 0), 6)
    journal.note_sent(made, "job-0")  # the answer is to the last one
    assert [(doubt.cap_s, doubt.number) for doubt in journal.charges.doubts()] == [(8, 0)]
    charge(journal, "job-0", 5.75)
    assert (told(journal), cap(journal)) == ((13.75, 5.75), 6)
    journal.charges.drop(journal.charges.doubts()[0])
    assert told(journal) == (5.75, 5.75)


def test_a_second_job_counts_with_its_cap_then_its_charge(journal: Journal) -> None:
    made = sent(journal, 6)
    charge(journal, "job-0", 2.0)
    sent_at = made.sent_at
    assert sent_at is not None
    journal.charges.note_unexpected(0, 10_000, 6, sent_at, "job-x")
    assert (told(journal), cap(journal)) == ((8, 2), 12)
    charge(journal, "job-x", 1.5)
    assert (told(journal), cap(journal)) == ((3.5, 3.5), 16)


def test_a_job_that_failed_counts_with_its_charge(journal: Journal) -> None:
    for attempt, charged_s in enumerate((0.0, 3.0)):
        journal.note_failed(sent(journal, 15, job_id=f"job-{attempt}"), "no")
        charge(journal, f"job-{attempt}", charged_s)
    assert (told(journal), cap(journal)) == ((3, 3), 17)


def test_sums_are_those_of_whoever_opens_the_journal_next(journal: Journal) -> None:
    """They are cached, and recomputed when another process may have written."""
    journal.allow(100.0)
    rng = np.random.default_rng(0)
    charged_s = rng.uniform(1, 12, 50)
    assert told(journal) == (0, 0)
    for number, seconds in enumerate(charged_s):
        done(journal, float(seconds), number)
    for seen in (journal, Journal(journal.folder)):
        assert seen.charges.settled_s == pytest.approx(math.fsum(charged_s))
        assert seen.charges.worst_ratio == pytest.approx(max(charged_s) / ESTIMATE_S)
        assert seen.jobs_done() == 50
    with Journal(journal.folder) as other:
        done(other, 7.0, 50)
    with journal.locked():
        assert journal.charges.settled_s == pytest.approx(math.fsum(charged_s) + 7)
        assert journal.jobs_done() == 51


@pytest.mark.parametrize("ended", ["done", "failed"])
def test_the_worst_ratio_of_charge_to_estimate_is_expected_of_the_next(
    journal: Journal, ended: str
) -> None:
    """The worst ratio counts every charge: a job that was stopped took at least that long."""
    budget = Budget(journal)
    journal.allow(1000.0)

    def end(number: int, charged_s: float | None) -> None:
        made = sent(journal, 100, number)
        if ended == "done":
            journal.note_done(made, [])
        else:
            journal.note_failed(made, "no")
        if charged_s is not None:
            charge(journal, f"job-{number}", charged_s)

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
    assert cap(journal, 11_428) == 6
    with pytest.raises(BudgetError):
        cap(journal, 11_429)


def test_the_refusal_says_what_is_spent_and_what_the_next_job_takes(journal: Journal) -> None:
    done(journal, 11.0)
    done(journal, None, 1, cap_s=4)
    with pytest.raises(BudgetError) as caught:
        cap(journal)
    assert str(caught.value) == (
        "The limit of 20 QPU seconds would be exceeded: 15.0 s are spent or may still be "
        "charged, and the next job takes about 11.0 s."
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
    """5.9 s are left, IBM would stop at 5, and 5.5 are expected."""
    journal.allow(11.4)
    done(journal, 5.5)
    with pytest.raises(BudgetError, match=r"the next job takes about 5\.5 s"):
        cap(journal)


def test_what_a_job_costs_the_guard_does_not_grow_with_the_run(journal: Journal) -> None:
    """Counted in instructions of SQLite, once the sums are there."""
    journal.allow(1e6)

    def instructions(number: int) -> int:
        """For everything the journal is asked for one job of a run."""
        steps = 0

        def count() -> None:
            nonlocal steps
            steps += 1

        told(journal)
        journal.jobs_done()
        journal._db.connection.set_progress_handler(count, 1)
        cap(journal)
        told(journal)
        journal.jobs_done()
        journal.latest(number)
        journal.charges.uncharged()
        journal.charges.doubts(number)
        done(journal, 2.0, number)
        journal._db.connection.set_progress_handler(None, 1)
        return steps

    few = instructions(0)
    with journal._db.at_once():
        for number in range(1, 1500):
            values = (number, 0, f"tag-{number}", "d", 100, "done", f"job-{number}")
            journal._db.do(
                "INSERT INTO submission (number, attempt, tag, digest, executions, state, job_id) "
                "VALUES (?,?,?,?,?,?,?)",
                *values,
            )
            journal._db.do(
                "INSERT INTO charge (number, executions, cap_s, sent_at, refused, job_id, "
                "charged_s) VALUES (?, 100, 5, ?, 0, ?, 2.0)",
                *(number, journal.created.isoformat(), f"job-{number}"),
            )
    journal.charges.forget_sums()
    many = instructions(1500)
    assert many < 1.2 * few


@pytest.mark.parametrize("limit_s", [math.inf, -math.inf, math.nan, -1.0, 0.0, 1.1e6])
def test_a_limit_that_cannot_be_kept_is_refused_and_changes_nothing(
    journal: Journal, limit_s: float
) -> None:
    with pytest.raises(BudgetError, match=r"QPU seconds\.\n  Give a number above 0"):
        journal.allow(limit_s)
    assert journal.max_qpu_seconds == 20
    with pytest.raises(BudgetError):
        Journal.create(Path("runs"), "run", "cart", {}, {}, limit_s)
    assert len(list(Path("runs").iterdir())) == 1


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
    """IBM charges a job's time or its cap, for some jobs only long after all are sent."""
    total, late = 0.0, {}
    with new() as journal:
        journal.allow(limit_s)
        for number, (executions, factor, says) in enumerate(jobs):
            made = journal.intend(number, "d", executions)
            try:
                cap_s = cap(journal, executions)
            except BudgetError:
                continue
            charged_s = min(factor * (2 + 0.00035 * executions), cap_s)
            journal.note_sent(journal.note_sending(made, cap_s), f"job-{number}")
            journal.note_done(made, [])
            if says:
                charge(journal, f"job-{number}", charged_s)
            else:
                late[f"job-{number}"] = charged_s
            total += charged_s
            assert total - 1e-9 <= journal.charges.upper_s <= limit_s + 1e-9
        assert total <= limit_s
        for job_id, charged_s in late.items():
            charge(journal, job_id, charged_s)
        assert told(journal) == pytest.approx((total, total))
