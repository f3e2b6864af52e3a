"""Jobs that IBM accepted without an answer, and lists late: found, or counted with the next one."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, number_of, played
from standin import Fault
from standin.service import Service

from qcompile.live.runs import find_journal

SUBMIT = "POST /jobs"
ACCEPTED = (Fault.ACCEPTED_504, Fault.ACCEPTED_DROPPED)


def list_with_the_second(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs are listed from the moment on that a second one has been accepted."""
    real = Service.submit

    def submit(self: Service, body: Any) -> Any:
        job = real(self, body)
        if len(self.entries()) == 2:
            runs.service.faults.listing_lag_seconds = 0
        return job

    monkeypatch.setattr(Service, "submit", submit)


@pytest.mark.parametrize("kind", ACCEPTED)
def test_a_job_that_is_listed_late_is_found(
    runs: Runs, undisturbed: dict[str, Any], kind: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.sender.SETTLE_S", 0.3)
    runs.service.faults.listing_lag_seconds = 0.2
    runs.service.faults.once(kind, on=SUBMIT, times=2)
    found = runs.until_finished(runs.run())
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


@pytest.mark.parametrize("queue_s", [0.0, 0.3])
def test_a_job_listed_after_another_was_sent_ends_with_both_counted(
    runs: Runs, undisturbed: dict[str, Any], queue_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Later than the settling time: the second one is cancelled, where that is still possible."""
    list_with_the_second(runs, monkeypatch)
    runs.service.settings.queue_seconds = queue_s
    runs.service.settings.run_seconds = 0.0
    runs.service.faults.listing_lag_seconds = 3600
    runs.service.faults.once(Fault.ACCEPTED_504, on=SUBMIT)
    found = runs.until_finished(runs.run())
    assert runs.errors == []
    assert played(found) == undisturbed
    ledger = runs.service.ledger()
    numbers = [number_of(job) for job in ledger.jobs]
    assert numbers == [(0, 0), (0, 0), (1, 0), (2, 0)]
    second = ledger.jobs[1]
    assert second.results_fetched == 0
    assert (second.status, second.charged_seconds > 0) == (
        ("Cancelled", False) if queue_s else ("Completed", True)
    )
    assert found["qpu_seconds"] == pytest.approx(ledger.charged_seconds)
    assert found["jobs_uncharged"] == 0
    with find_journal(Path("runs"), "last") as journal:
        assert len(journal.charges.all()) == 4


def test_a_job_listed_only_after_another_was_accepted_is_counted(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Too late to be seen when the second was sent, and too late to be cancelled."""
    real, faults = Service.submit, runs.service.faults

    def submit(self: Service, body: Any) -> Any:
        job = real(self, body)
        if len(self.entries()) == 2:
            runs.service.settings.queue_seconds = 0.0
            threading.Timer(0.3, setattr, (faults, "listing_lag_seconds", 0.0)).start()
        return job

    monkeypatch.setattr(Service, "submit", submit)
    runs.service.settings.queue_seconds = 0.5
    faults.listing_lag_seconds = 3600
    faults.once(Fault.ACCEPTED_504, on=SUBMIT)
    found = runs.until_finished(runs.run())
    assert runs.errors == []
    assert played(found) == undisturbed
    ledger = runs.service.ledger()
    assert [number_of(job) for job in ledger.jobs] == [(0, 0), (0, 0), (1, 0), (2, 0)]
    assert [job.charged_seconds > 0 for job in ledger.jobs] == [True] * 4
    assert found["qpu_seconds"] == pytest.approx(ledger.charged_seconds)


def test_the_limit_holds_where_two_jobs_of_a_step_may_be_charged(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first is listed after the second was sent, and either takes thrice what it should."""
    list_with_the_second(runs, monkeypatch)
    runs.service.settings.usage_factor = 3.0
    runs.service.faults.listing_lag_seconds = 3600
    runs.service.faults.once(Fault.ACCEPTED_504, on=SUBMIT)
    answer = runs.run(max_qpu_seconds=8)
    assert answer.code == 1
    assert "The limit of 8 QPU seconds would be exceeded" in answer.err
    assert 0 < runs.service.ledger().charged_seconds <= 8
