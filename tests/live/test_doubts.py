"""Jobs that IBM may have accepted: no less is reported than its ledger charges."""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_runs import Runs, check_paid_once, played
from standin import Fault
from standin.errors import ApiError
from standin.service import Service

from qcompile.live.runs import find_journal

SUBMIT = "POST /jobs"
STEP_S = 2.1792
"""A job of two circuits of 256 shots: 2 + 512 * 0.00035; it is capped at 4 times that and 10."""
CAP_S = 19


def told(runs: Runs) -> dict[str, Any]:
    """The report of `qcompile runs` on the only run."""
    [row] = runs.call("runs", "--json").json()
    return dict(row)


def answer(monkeypatch: pytest.MonkeyPatch, status: int, *calls: int, accepted: bool) -> None:
    """Let the service answer with an error to the submissions with these numbers, from 0."""
    real, count = Service.submit, itertools.count()

    def submit(self: Service, body: Any) -> Any:
        struck = next(count) in calls
        job = real(self, body) if accepted or not struck else None
        if struck:
            raise ApiError(status, 1517, "I do not take it.")
        return job

    monkeypatch.setattr(Service, "submit", submit)


@pytest.mark.parametrize("kind", [Fault.ACCEPTED_504, Fault.ACCEPTED_DROPPED])
def test_a_job_that_is_listed_after_the_end_is_told_at_its_cap_and_then_at_its_charge(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault
) -> None:
    runs.service.faults.listing_lag_seconds = 3600
    runs.service.faults.once(kind, on=SUBMIT)
    found = runs.run()
    ledger = runs.service.ledger()
    assert [job.charged_seconds for job in ledger.jobs] == [pytest.approx(STEP_S)] * 4
    result = found.json()
    assert played(result) == undisturbed
    assert result["qpu_seconds"] == pytest.approx(3 * STEP_S + CAP_S)
    assert result["qpu_seconds_settled"] == pytest.approx(3 * STEP_S)
    assert (result["jobs_in_doubt"], result["jobs_uncharged"]) == (1, 0)
    assert "IBM may have accepted 1 more job, at most 19 s; `qcompile" in found.err
    assert " UTC finds out.\n" in found.err

    again = runs.call("resume", "last", "--json").json()  # IBM does not list it yet
    assert (again["qpu_seconds"], again["jobs_in_doubt"]) == (result["qpu_seconds"], 1)
    runs.service.faults.listing_lag_seconds = 0
    last = runs.call("resume", "last", "--json")
    assert "may have accepted" not in last.err
    assert last.json()["qpu_seconds"] == pytest.approx(ledger.charged_seconds)
    assert last.json()["qpu_seconds_settled"] == pytest.approx(ledger.charged_seconds)
    assert last.json()["jobs_in_doubt"] == 0
    before = runs.service.ledger()
    assert runs.call("resume", "last", "--json").json() == last.json()
    assert runs.service.ledger().jobs == before.jobs
    assert len(before.jobs) == 4


def test_a_job_that_was_never_accepted_is_dropped_when_ibm_must_list_it(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    runs.service.faults.once(Fault.DROPPED, on=SUBMIT)
    found = runs.until_finished(runs.run())
    assert played(found) == undisturbed
    assert (found["jobs_in_doubt"], found["qpu_seconds"]) == (1, pytest.approx(3 * STEP_S + CAP_S))
    assert runs.call("resume", "last", "--json").json()["jobs_in_doubt"] == 1
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "0")
    found = runs.call("resume", "last", "--json").json()
    assert found["jobs_in_doubt"] == 0
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
    check_paid_once(runs.service, 3)


def test_a_doubt_without_a_connection_is_none(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    """A request that never left this machine cannot have been accepted."""
    from requests.adapters import HTTPAdapter

    real, count = HTTPAdapter.send, itertools.count()

    def send(self: Any, request: Any, *args: Any, **options: Any) -> Any:
        if request.method == "POST" and request.url.endswith("/jobs") and next(count) == 0:
            request.url = "http://127.0.0.1:9/jobs"  # where nobody listens
        return real(self, request, *args, **options)

    monkeypatch.setattr(HTTPAdapter, "send", send)
    found = runs.run().json()
    assert next(count) == 4
    assert found["jobs_in_doubt"] == 0
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


@pytest.mark.parametrize("seed", range(3))
def test_the_limit_holds_in_what_is_told_where_most_answers_are_lost(
    runs: Runs, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Listings are late by several settling times; charges come late as well."""
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.05, 0.2))
    runs.service.faults._rng = np.random.default_rng(seed)
    runs.service.faults.listing_lag_seconds = 0.4
    runs.service.settings.usage_lag_seconds = 0.1
    runs.service.faults.chance(Fault.ACCEPTED_504, 0.6, on=SUBMIT)
    answer = runs.run(max_qpu_seconds=30, max_steps=5)
    for _ in range(4):
        time.sleep(runs.service.faults.listing_lag_seconds)
        charged_s = runs.service.ledger().charged_seconds
        row = told(runs)
        assert charged_s - 1e-9 <= row["qpu_seconds"] <= 30
        assert row["qpu_seconds_settled"] <= charged_s + 1e-9
        answer = runs.call("resume", "last", "--json")
    assert answer.code == 0, answer.err
    assert told(runs)["jobs_in_doubt"] == 0
    assert told(runs)["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


@pytest.mark.parametrize("status", [400, 401, 403, 404, 409, 413, 429, 500])
def test_an_error_to_a_job_that_was_accepted_is_looked_into_before_it_is_sent_again(
    runs: Runs, undisturbed: dict[str, Any], status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer(monkeypatch, status, 0, accepted=True)
    found = runs.run().json()
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3
    assert found["jobs_in_doubt"] == 0
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


@pytest.mark.parametrize("status", [404, 429])
def test_an_error_to_a_job_that_is_listed_late_is_told(
    runs: Runs, undisturbed: dict[str, Any], status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer(monkeypatch, status, 0, accepted=True)
    runs.service.faults.listing_lag_seconds = 3600
    found = runs.until_finished(runs.run())
    assert played(found) == undisturbed
    assert len(runs.service.ledger().jobs) == 4
    assert found["qpu_seconds"] >= runs.service.ledger().charged_seconds
    assert found["jobs_in_doubt"] == 1


def test_a_refusal_of_a_busy_service_does_not_take_of_the_limit_for_long(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit just covers the run: a refused job that counted for an hour would stop it."""
    monkeypatch.setattr("qcompile.live.finder.REFUSED_S", 0.4)
    runs.service.faults.once(Fault.RATE_LIMITED, on=SUBMIT)
    found = runs.run(max_qpu_seconds=8)
    assert found.code == 0, found.err
    assert played(found.json()) == undisturbed
    check_paid_once(runs.service, 3, 8)
    assert found.json()["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


def test_a_submission_that_stays_unanswered_stops_a_run_at_its_limit(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The ledger charges nothing, but it might, and the limit has no room for both."""
    runs.service.faults.once(Fault.SERVER_ERROR, on=SUBMIT)
    stopped = runs.run(max_qpu_seconds=8)
    assert stopped.code == 1
    assert "The limit of 8 QPU seconds would be exceeded: 8.0 s are spent or may" in stopped.err
    assert "IBM may have accepted 1 more job, at most 8 s; " in stopped.err
    assert not runs.service.ledger().jobs
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "0")
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert runs.errors == []
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3, 8)


def test_a_killed_process_leaves_a_doubt(runs: Runs) -> None:
    """Its journal says that a job is being sent, so it counts and is reported."""
    runs.run()
    with find_journal(Path("runs"), "last") as journal:
        journal.note_sending(journal.intend(9, "d", 512), 7)
    charged_s = runs.service.ledger().charged_seconds
    row = told(runs)
    assert (row["jobs_in_doubt"], row["qpu_seconds"]) == (1, pytest.approx(charged_s + 7))
    assert row["qpu_seconds_settled"] == pytest.approx(charged_s)
