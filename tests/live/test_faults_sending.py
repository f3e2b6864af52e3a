"""Exactly once, whatever happens to a request: same result, one paid job for each step."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, played
from standin import Fault

SUBMIT = "POST /jobs"
BEFORE = (
    Fault.RATE_LIMITED,
    Fault.SERVER_ERROR,
    Fault.BAD_GATEWAY,
    Fault.UNAVAILABLE,
    Fault.GATEWAY_TIMEOUT,
    Fault.DROPPED,
)
ACCEPTED = (Fault.ACCEPTED_504, Fault.ACCEPTED_DROPPED)


@pytest.mark.parametrize(
    ("kind", "times"),
    [*((kind, 1) for kind in BEFORE), *((kind, 2) for kind in (*ACCEPTED, Fault.CUT_ANSWER))],
)
def test_submissions_that_go_wrong(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault, times: int
) -> None:
    runs.service.faults.once(kind, on=SUBMIT, times=times)
    found = runs.until_finished(runs.run())
    assert runs.errors == []
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert runs.service.ledger().faults[kind] == times
    assert len(runs.service.ledger().jobs) == 3


@pytest.mark.parametrize("kind", [Fault.SERVER_ERROR, Fault.DROPPED])
def test_a_service_that_takes_nothing_is_explained_and_resumed(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault
) -> None:
    """A submission is given up after five times; the fault strikes the sixth as well."""
    runs.service.faults.once(kind, on=SUBMIT, times=6)
    found = runs.until_finished(runs.run())
    [words] = runs.errors
    assert "0 jobs are done, 0 steps are played; all of it is kept." in words
    assert "Traceback" not in words
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)


@pytest.mark.parametrize("kind", ACCEPTED)
def test_a_job_that_is_listed_late_is_found(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.sending.SETTLE_S", 0.3)
    runs.service.faults.listing_lag_seconds = 0.2
    runs.service.faults.once(kind, on=SUBMIT, times=2)
    found = runs.until_finished(runs.run())
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


def test_a_second_job_of_the_same_step_is_cancelled_uncharged(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """It can be there where a folder was restored from a copy, and both went on."""
    runs.service.settings.queue_seconds = 1.0
    assert runs.run("--max-wait-seconds", 0.1).code == 1
    [folder] = Path("runs").iterdir()
    shutil.copytree(folder, Path("copies") / folder.name)
    for runs_folder, change in (
        ("copies", "DELETE FROM submission"),
        ("runs", "UPDATE submission SET state = 'intended', job_id = NULL"),
    ):
        with sqlite3.connect(Path(runs_folder) / folder.name / "journal.sqlite") as db:
            db.execute(change)
    sent_again = runs.call("resume", "last", "--runs", "copies", "--max-wait-seconds", 0.1)
    assert sent_again.code == 1
    assert len(runs.service.ledger().jobs) == 2
    runs.service.settings.queue_seconds = 0.0
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    states = [job.status for job in runs.service.ledger().jobs]
    assert states == ["Completed", "Cancelled", "Completed", "Completed"]
    check_paid_once(runs.service, 3)


READS = (
    "GET /jobs/{id}",
    "GET /jobs/{id}/results",
    "GET /jobs/{id}/metrics",
    "GET /backends/{id}/configuration",
    "GET /instances/usage",
)


@pytest.mark.parametrize("request_", READS)
@pytest.mark.parametrize("kind", [Fault.DROPPED, Fault.CUT_ANSWER])
def test_questions_that_are_not_answered_are_asked_again(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault, request_: str
) -> None:
    runs.service.faults.once(kind, on=request_)
    found = runs.until_finished(runs.run())
    assert runs.errors == []
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert runs.service.ledger().faults[kind] == 1


def test_looking_for_a_job_may_go_wrong_as_well(runs: Runs, undisturbed: dict[str, Any]) -> None:
    runs.service.faults.once(Fault.ACCEPTED_504, on=SUBMIT)
    runs.service.faults.once(Fault.CUT_ANSWER, on="GET /jobs")
    runs.service.faults.once(Fault.SERVER_ERROR, on="GET /jobs")
    found = runs.until_finished(runs.run())
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)


def test_all_faults_at_random(runs: Runs, undisturbed: dict[str, Any]) -> None:
    for kind in BEFORE:
        runs.service.faults.chance(kind, 0.1, on=SUBMIT)
        runs.service.faults.chance(kind, 0.02, on="GET /jobs/{id}")
    for kind in (*ACCEPTED, Fault.CUT_ANSWER):
        runs.service.faults.chance(kind, 0.2, on=SUBMIT)
    found = runs.until_finished(runs.run())
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert sum(runs.service.ledger().faults.values()) > 2
