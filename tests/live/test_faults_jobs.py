"""Jobs that fail, are cancelled, or wait; and results that cannot be read: never paid twice."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import pytest
from live_runs import LIMIT_S, Runs, check_paid_once, number_of, played
from standin import Fault

from qcompile.live.billing import Billing
from qcompile.live.perform import complete
from qcompile.live.runs import find_journal

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
    assert "  It was charged 0 s; this was attempt 3.\n" in answer.err
    assert answer.err.endswith(f"  `qcompile resume {run_id()}` resumes it.\n")
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
    answer = runs.run("--max-wait-seconds", 0.2)
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert f"Error: Job {job.id} has been queued for 0 s.\n" in answer.err
    assert "  It stays in the queue; resume to fetch it once it is done.\n" in answer.err
    assert answer.err.endswith(f"  `qcompile resume {run_id()}` resumes it.\n")
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
    assert f"The result of job {job.id} could not be read in 4 attempts." in answer.err
    assert "  It is paid for and is not sent again: resuming fetches it once more.\n" in answer.err
    runs.service.faults.clear()
    assert played(runs.until_finished(runs.call("resume", "last", "--json"))) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


def test_a_charge_that_comes_late_is_not_guessed_and_learnt_later(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """A result counts jobs without a reported charge with their caps: 19 s each."""
    runs.service.settings.usage_lag_seconds = 3600
    found = runs.run().json()
    assert played(found) == undisturbed
    assert (found["qpu_seconds_settled"], found["jobs_uncharged"]) == (0, 3)
    assert found["qpu_seconds"] == 3 * 19
    shown = runs.call("runs", "show", "last", "--json").json()
    assert shown["result"] == found
    assert (shown["qpu_seconds"], shown["jobs_uncharged"]) == (3 * 19, 3)
    runs.service.settings.usage_lag_seconds = 0
    assert runs.call("runs", "show", "last", "--json").json() == shown  # it asks nobody
    again = runs.call("resume", "last", "--json").json()
    charged = runs.service.ledger().charged_seconds
    assert played(again) == undisturbed
    assert (again["qpu_seconds"], again["jobs_uncharged"]) == (pytest.approx(charged), 0)
    shown = runs.call("runs", "show", "last", "--json").json()
    assert (shown["result"], shown["jobs_uncharged"]) == (again, 0)
    jobs = runs.call("runs", "export", "last").json()["jobs"]
    assert [job["qpu_seconds"] for job in jobs] == pytest.approx([charged / 3] * 3)
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


def test_charges_are_learnt_in_between_before_there_are_too_many(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.billing._MAX_UNCHARGED", 2)
    runs.service.settings.usage_lag_seconds = 3600
    real, told = Billing._wait, []

    def wait(self: Billing, pause_s: float) -> None:
        runs.service.settings.usage_lag_seconds = 0
        told.append(len(self._charges.uncharged()))
        real(self, pause_s)

    monkeypatch.setattr(Billing, "_wait", wait)
    found = runs.run().json()
    assert played(found) == undisturbed
    assert told == [2]  # before the third job; at the end nothing is left to ask
    assert found["jobs_uncharged"] == 0


def test_a_deleted_job_is_explained_and_sent_once_more(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """Its charge stays unknown and counts with its cap."""
    from qiskit_ibm_runtime import QiskitRuntimeService

    runs.service.settings.queue_seconds = 0.2
    assert runs.run("--max-wait-seconds", 0.05).code == 1
    [job] = runs.service.ledger().jobs
    time.sleep(0.3)
    QiskitRuntimeService().delete_job(job.id)
    runs.service.settings.queue_seconds = 0.0
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert answer.err.split("Error: ")[1] == (
        f"IBM no longer has job {job.id}: it was deleted.\n"
        "  Resuming sends it once more and pays for it again.\n"
        "  Jobs done: 0, steps played: 0; everything is kept.\n"
        f"  `qcompile resume {run_id()}` resumes it.\n"
    )
    assert len(runs.service.ledger().jobs) == 1  # nothing is sent before somebody says so
    again = runs.call("resume", "last")
    assert again.code == 1
    assert (
        f"Error: Job {job.id} returned no counts. IBM says: it no longer has the job.\n"
        "  It may still be charged. It is sent and paid for again only if you allow it.\n"
        "  Jobs done: 0, steps played: 0; everything is kept.\n"
        f"  `qcompile resume {run_id()} --yes` sends it again.\n"
    ) in again.err
    assert len(runs.service.ledger().jobs) == 1
    found = runs.until_finished(runs.call("resume", "last", "--json", "--yes"))
    assert runs.errors == []
    assert played(found) == undisturbed
    first, *others = runs.service.ledger().jobs
    assert [number_of(entry) for entry in others] == [(0, 1), (1, 0), (2, 0)]
    assert first.deleted
    assert found["jobs_uncharged"] == 1
    charged_s = sum(entry.charged_seconds for entry in others)
    assert found["qpu_seconds_settled"] == pytest.approx(charged_s)
    assert found["qpu_seconds"] == pytest.approx(charged_s + 19)
    with find_journal(Path("runs"), "last") as journal:
        charge, *_ = journal.charges.all()
    assert (charge.cap_s, charge.charged_s) == (19, None)


def test_two_that_go_on_at_once_do_not_pay_twice(runs: Runs, undisturbed: dict[str, Any]) -> None:
    runs.service.settings.queue_seconds = 0.5
    assert runs.run("--max-wait-seconds", 0.05).code == 1

    def go_on_elsewhere() -> None:
        with find_journal(Path("runs"), "last") as journal:
            complete(journal)

    def asked() -> int:
        return runs.service.ledger().requests["GET /jobs/{id}"]

    before, other = asked(), threading.Thread(target=go_on_elsewhere)
    other.start()
    while asked() == before:
        assert other.is_alive()
        time.sleep(0.002)
    answer = runs.call("resume", "last", "--max-qpu-seconds", 70, "--yes")
    assert answer.code == 1
    assert answer.err.endswith(
        f"Error: Run {run_id()} is running in another process.\n  Wait for it, or stop it.\n"
    )
    other.join()
    found = runs.call("resume", "last", "--json").json()
    assert played(found) == undisturbed
    assert found["max_qpu_seconds"] == LIMIT_S  # of the one that was sent away nothing is kept
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


def run_id() -> str:
    """The submissions of the only run."""
    [folder] = Path("runs").iterdir()
    return folder.name
