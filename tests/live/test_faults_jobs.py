"""Jobs that fail, are cancelled, or wait; and results that cannot be read: never paid twice."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, number_of, played
from standin import Fault

from qcompile.live.budget import Budget
from qcompile.live.journal import find_journal

SUBMIT, RESULTS = "POST /jobs", "GET /jobs/{id}/results"
SPOILED = (Fault.RESULTS_TRUNCATED, Fault.RESULTS_MISSHAPEN, Fault.RESULTS_EMPTY)


def test_a_job_that_fails_uncharged_is_sent_again(runs: Runs, undisturbed: dict[str, Any]) -> None:
    runs.service.faults.once(Fault.JOB_FAILS, times=2)
    answer = runs.run()
    assert answer.code == 0
    assert played(answer.json()) == undisturbed
    check_paid_once(runs.service, 3)
    attempts = [number_of(job) for job in runs.service.ledger().jobs]
    assert attempts == [(0, 0), (0, 1), (0, 2), (1, 0), (2, 0)]


def test_a_job_that_fails_three_times_is_explained(runs: Runs, undisturbed: dict[str, Any]) -> None:
    runs.service.faults.once(Fault.JOB_FAILS, times=3)
    answer = runs.run()
    assert answer.code == 1
    failed = runs.service.ledger().jobs
    assert [(job.status, job.charged_seconds) for job in failed] == [("Failed", 0)] * 3
    assert f"Job {failed[-1].id} failed: " in answer.err
    assert "Internal error of the system." in answer.err
    assert "IBM charged 0 s for it; this was attempt 3." in answer.err
    assert "sends it once more" in answer.err
    assert played(runs.until_finished(runs.call("resume", "last", "--json"))) == undisturbed
    check_paid_once(runs.service, 3)


def test_a_cancelled_job_is_explained_and_sent_once_more(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    runs.service.faults.once(Fault.JOB_CANCELLED)
    answer = runs.run()
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert f"Error: Job {job.id} was cancelled.\n" in answer.err
    assert played(runs.until_finished(runs.call("resume", "last", "--json"))) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 4


def test_a_job_that_waits_for_long_is_left_and_fetched_later(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    runs.service.faults.wait_seconds = 1.0
    runs.service.faults.once(Fault.JOB_WAITS)
    started = time.monotonic()
    answer = runs.run("--max-wait-seconds", 0.2)
    assert time.monotonic() - started < 1.0
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert f"Error: Job {job.id} is queued for 0 s now.\n" in answer.err
    assert "fetches it once it is done." in answer.err
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


@pytest.mark.parametrize("kind", SPOILED)
def test_results_that_cannot_be_read_are_fetched_again(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault
) -> None:
    runs.service.faults.once(kind)
    answer = runs.run()
    assert answer.code == 0, answer.err
    assert played(answer.json()) == undisturbed
    check_paid_once(runs.service, 3)
    assert runs.service.ledger().faults[kind] == 1


@pytest.mark.parametrize("kind", SPOILED)
def test_results_that_stay_unreadable_are_explained_and_never_paid_twice(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.jobs._FETCH_PAUSE_S", 0.01)
    runs.service.faults.once(kind, times=200)
    answer = runs.run()
    assert answer.code == 1
    assert "Traceback" not in answer.err
    for _ in range(2):
        assert runs.call("resume", "last").code == 1
    [job] = runs.service.ledger().jobs
    assert (job.status, job.id in answer.err) == ("Completed", True)
    assert f"The result of job {job.id} cannot be read, 4 times." in answer.err
    assert "It is paid and not sent again" in answer.err
    runs.service.faults.clear()
    assert played(runs.until_finished(runs.call("resume", "last", "--json"))) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


def test_a_usage_that_comes_late_is_not_guessed(runs: Runs, undisturbed: dict[str, Any]) -> None:
    """What IBM has not charged yet is no charge; the estimate counts against the limit."""
    runs.service.settings.usage_lag_seconds = 0.2
    found = runs.run().json()
    assert played(found) == undisturbed
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


def test_a_charge_that_never_comes_counts_with_its_estimate(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three jobs of 512 executions are estimated at 6.5376 s."""
    monkeypatch.setattr("qcompile.live.jobs._USAGE_POLLS", 1)
    runs.service.settings.usage_lag_seconds = 3600
    found = runs.run(max_qpu_seconds=6.54).json()
    assert found["qpu_seconds"] == 0
    budget = Budget(find_journal(Path("runs"), "last"))
    assert budget.spent_s() == pytest.approx(6.5376)
