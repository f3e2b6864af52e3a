"""Each job is sent exactly once, whatever happens: same result, one paid job per step."""

from __future__ import annotations

import itertools
import shutil
import sqlite3
import time
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, played
from standin import Fault
from standin.errors import ApiError
from standin.service import Service

from qcompile.live.runs import find_journal

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
    runs: Runs, undisturbed: dict[str, Any], kind: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A submission is given up after three attempts. Each may have been accepted."""
    runs.service.faults.once(kind, on=SUBMIT, times=3)
    answer = runs.run()
    assert answer.code == 1
    assert "Error: IBM's service does not answer.\n" in answer.err
    assert "  Jobs done: 0, steps played: 0; everything is kept.\n" in answer.err
    [row] = runs.call("runs", "--json").json()
    assert (row["jobs_in_doubt"], row["qpu_seconds"], row["qpu_seconds_settled"]) == (3, 57, 0)
    stopped = runs.call("resume", "last")  # the first job fits what is left, the second does not
    assert stopped.code == 1
    assert "  IBM may have accepted 3 more jobs, at most 57 s; " in stopped.err
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "0")
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert runs.errors == []
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert found["jobs_in_doubt"] == 0
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


def test_a_restored_copy_finds_what_was_sent_since(runs: Runs, undisturbed: dict[str, Any]) -> None:
    """A folder was restored from a copy and both continue: the second finds the job by its tag."""
    runs.service.settings.queue_seconds = 1.0
    assert runs.run("--max-wait-seconds", 0.1).code == 1
    [folder] = Path("runs").iterdir()
    shutil.copytree(folder, Path("copies") / folder.name)
    for runs_folder, change in (
        ("copies", "DELETE FROM submission"),
        ("runs", "UPDATE submission SET state = 'sending', job_id = NULL"),
    ):
        with sqlite3.connect(Path(runs_folder) / folder.name / "journal.sqlite") as db:
            db.execute(change)
    sent_again = runs.call(
        *("resume", "last", "--runs", "copies", "--yes", "--max-wait-seconds", 0.1)
    )
    assert sent_again.code == 1
    assert len(runs.service.ledger().jobs) == 1
    runs.service.settings.queue_seconds = 0.0
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


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


def test_all_faults_at_random(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "1")  # else many doubts stop the run at its limit
    for kind in BEFORE:
        runs.service.faults.chance(kind, 0.1, on=SUBMIT)
        runs.service.faults.chance(kind, 0.02, on="GET /jobs/{id}")
    for kind in (*ACCEPTED, Fault.CUT_ANSWER):
        runs.service.faults.chance(kind, 0.2, on=SUBMIT)
    found = runs.until_finished(runs.run())
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert sum(runs.service.ledger().faults.values()) > 2


def refuse(monkeypatch: pytest.MonkeyPatch, *calls: int) -> None:
    """Let the service refuse the submissions with these numbers, from 0."""
    real, count = Service.submit, itertools.count()

    def submit(self: Service, body: Any) -> Any:
        if next(count) in calls:
            raise ApiError(400, 1517, "I do not take it.")
        return real(self, body)

    monkeypatch.setattr(Service, "submit", submit)


def states() -> list[tuple[str, int]]:
    """State and attempt of every submission of the only run."""
    with find_journal(Path("runs"), "last") as journal:
        return [(made.state, made.attempt) for made in journal.submissions()]


def test_a_job_that_is_refused_is_explained_and_costs_nothing(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse(monkeypatch, 0)
    answer = runs.run()
    assert answer.code == 1
    assert "Error: IBM's service or client refused the request.\n  It says: " in answer.err
    assert "I do not take it." in answer.err
    assert states() == [("sending", 0)]
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    assert states() == [("done", 0)] * 3
    check_paid_once(runs.service, 3)


@pytest.mark.parametrize("kind", ACCEPTED)
def test_a_refusal_after_no_answer_says_nothing_about_the_job_before(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first was accepted, is listed late, and is found when the run resumes."""
    refuse(monkeypatch, 1)
    runs.service.faults.listing_lag_seconds = 3600
    runs.service.faults.once(kind, on=SUBMIT)
    answer = runs.run()
    assert answer.code == 1
    assert "I do not take it." in answer.err
    assert states() == [("sending", 0)]
    runs.service.faults.listing_lag_seconds = 0
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert runs.errors == []
    assert played(found) == undisturbed
    assert states() == [("done", 0)] * 3
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


def test_an_account_without_a_job_is_looked_at_before_one_is_sent_again(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that was stopped while sending looks for its job first, and then sends."""
    asked: list[float] = []
    monkeypatch.setenv("QCOMPILE_SETTLE_SECONDS", "0")
    runs.service.faults.once(Fault.DROPPED, on=SUBMIT, times=3)
    answer = runs.run(max_qpu_seconds=100)
    assert answer.code == 1
    with find_journal(Path("runs"), "last") as journal:
        *_, last = journal.charges.doubts()
    sent_at = last.sent_at.timestamp()
    monkeypatch.setenv("QCOMPILE_SETTLE_SECONDS", "0.75")
    assert states() == [("sending", 0)]
    runs.service.faults.clear()
    real = Service.submit

    def submit(self: Service, body: Any) -> Any:
        asked.append(time.time())
        return real(self, body)

    monkeypatch.setattr(Service, "submit", submit)
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    assert asked[0] - sent_at >= 0.75
    check_paid_once(runs.service, 3)


@pytest.mark.parametrize("said", ["soon", "inf", "nan", "-1", "1e300", "86401"])
def test_a_settling_time_that_is_no_number_of_seconds_is_explained(
    runs: Runs, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("QCOMPILE_SETTLE_SECONDS", said)
    answer = runs.run()
    assert answer.code == 1
    assert answer.err.endswith(
        f"Error: QCOMPILE_SETTLE_SECONDS is {said!r}.\n"
        "  It must be a number of seconds, such as 0.05, and at most a day.\n"
    )
    assert not runs.service.ledger().jobs
