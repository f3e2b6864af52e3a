"""Copies of a run: an older one that is restored, and two that are resumed at the same time."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
from live_ledger import charged_s, jobs_of, settled_wrong, told_wrong
from live_runs import Runs, check_paid_once, played
from standin import Fault
from standin.service import Service

from qcompile.live.perform import complete
from qcompile.live.runs import find_journal

SUBMIT = "POST /jobs"


@pytest.fixture(autouse=True)
def short_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "0")
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.02, 0.02))


def stopped_after_its_first_job_was_sent(runs: Runs) -> str:
    """The id of a run whose first job is still in the queue."""
    runs.service.settings.queue_seconds = 0.3
    assert runs.run("--max-wait-seconds", 0.05).code == 1
    runs.service.settings.queue_seconds = 0.0
    [folder] = Path("runs").iterdir()
    return folder.name


def put_back(run: str) -> None:
    shutil.rmtree(Path("runs") / run)
    shutil.copytree(Path("copies") / run, Path("runs") / run)


def settled(runs: Runs, run: str, undisturbed: dict[str, Any], *words: object) -> dict[str, Any]:
    """The result of the run, once its books agree exactly with the service's."""
    found = runs.until_finished(runs.call("resume", run, "--json", "--yes", *words))
    assert played(found) == undisturbed
    assert settled_wrong(found, charged_s(jobs_of(runs.service, run))) == []
    return found


def test_of_a_run_restored_from_an_older_copy_no_job_is_paid_again(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """The copy knows of the first job; the two that were sent since are found by their tags."""
    run = stopped_after_its_first_job_was_sent(runs)
    shutil.copytree(Path("runs") / run, Path("copies") / run)
    settled(runs, run, undisturbed)
    put_back(run)
    settled(runs, run, undisturbed)
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


@pytest.mark.parametrize("times", [1, 2])
def test_jobs_sent_twice_before_the_copy_was_put_back_are_counted(
    runs: Runs, undisturbed: dict[str, Any], times: int
) -> None:
    """Some later jobs failed at the first attempt: their positions have more than one tag."""
    run = stopped_after_its_first_job_was_sent(runs)
    shutil.copytree(Path("runs") / run, Path("copies") / run)
    runs.service.faults.once(Fault.JOB_FAILS, times=times)
    settled(runs, run, undisturbed)
    assert len(runs.service.ledger().jobs) == 3 + times
    put_back(run)
    settled(runs, run, undisturbed)
    check_paid_once(runs.service, 3)


def test_a_run_restored_while_its_charges_are_pending_goes_on(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """Nothing is known about the cost of a job found by its tag except the cap it was sent with."""
    run = stopped_after_its_first_job_was_sent(runs)
    shutil.copytree(Path("runs") / run, Path("copies") / run)
    runs.service.settings.usage_lag_seconds = 3600.0
    for _ in range(2):
        found = runs.until_finished(runs.call("resume", run, "--json", "--yes"))
        assert played(found) == undisturbed
        assert (found["qpu_seconds_settled"], found["jobs_uncharged"]) == (0, 3)
        charged = charged_s(jobs_of(runs.service, run))
        assert told_wrong(found, charged, 60.0) == []
        put_back(run)
    runs.service.settings.usage_lag_seconds = 0.0
    settled(runs, run, undisturbed)
    check_paid_once(runs.service, 3)


def test_a_copy_that_goes_on_elsewhere_finds_what_the_other_sends_in_between(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One looks for the second job, finds none and sends it; then the other sends the third."""
    run = stopped_after_its_first_job_was_sent(runs)
    shutil.copytree(Path("runs") / run, Path("copies") / run)
    real, other = Service.submit, []

    def submit(self: Service, body: Any) -> Any:
        job = real(self, body)
        if not other:
            other.append(True)
            with find_journal(Path("copies"), run) as journal:
                journal.move_here()  # as whoever resumes it there confirms
                other.append(complete(journal))
        return job

    monkeypatch.setattr(Service, "submit", submit)
    settled(runs, run, undisturbed)
    _, found = other
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


def test_of_two_copies_that_both_pay_for_a_step_the_last_tells_of_both_jobs(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other one sends all its jobs just before this one's second is accepted."""
    run = stopped_after_its_first_job_was_sent(runs)
    shutil.copytree(Path("runs") / run, Path("copies") / run)
    real, count = Service.submit, iter(range(10))

    def submit(self: Service, body: Any) -> Any:
        if next(count) == 0:
            with find_journal(Path("copies"), run) as journal:
                journal.move_here()  # as whoever resumes it there confirms
                complete(journal)
        return real(self, body)

    monkeypatch.setattr(Service, "submit", submit)
    found = settled(runs, run, undisturbed)
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
    assert len(runs.service.ledger().jobs) == 4
    with find_journal(Path("copies"), run) as journal:  # which ended before the other's second job
        assert complete(journal)["qpu_seconds"] == pytest.approx(found["qpu_seconds"])
