"""A charged job without counts is sent again only by a person."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from live_ledger import charged_s, jobs_of, settled_wrong
from live_runs import Runs, number_of, played
from standin import CHARGES, Fault

from qcompile.live.runs import find_journal


@pytest.fixture(autouse=True)
def short_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "0")
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.02, 0.02))


def attempts(runs: Runs) -> list[tuple[int, int]]:
    return [number_of(job) for job in runs.service.ledger().jobs]


def run_id() -> str:
    with find_journal(Path("runs"), "last") as journal:
        return journal.id


@pytest.mark.parametrize("resent", [False, True])
def test_a_charged_failure_is_sent_again_by_a_person_alone(
    runs: Runs, undisturbed: dict[str, Any], resent: bool
) -> None:
    """Only after a confirmation, and not by `resume` alone: each attempt costs."""
    runs.service.faults.once(Fault.JOB_FAILS_CHARGED)
    answer = runs.run()
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert (job.status, job.charged_seconds > 0) == ("Failed", True)
    assert f"Error: Job {job.id} failed: " in answer.err
    assert f"{job.charged_seconds:g} s" in answer.err
    if not resent:
        assert runs.call("resume", "last").code == 1
        assert attempts(runs) == [(0, 0)]
        return
    found = runs.until_finished(runs.call("resume", "last", "--yes", "--json"))
    assert played(found) == undisturbed
    assert attempts(runs) == [(0, 0), (0, 1), (1, 0), (2, 0)]
    assert settled_wrong(found, charged_s(jobs_of(runs.service, run_id()))) == []


@pytest.mark.parametrize("charge", ["negative", "not a number", "null"])
def test_a_failure_with_a_charge_that_is_no_charge_may_have_been_charged(
    runs: Runs, charge: str
) -> None:
    """A job that may be charged is not sent again without asking."""
    runs.service.faults.once(Fault.JOB_FAILS_CHARGED)
    runs.service.faults.reshape(CHARGES[f"charge: {charge}"])
    assert runs.run().code == 1
    assert attempts(runs) == [(0, 0)]
    shown = runs.call("runs", "show", "last", "--json").json()
    assert shown["qpu_seconds"] >= runs.service.ledger().charged_seconds


def test_a_job_cut_off_is_not_sent_again_with_what_is_left(runs: Runs) -> None:
    """It took seven times what it should: the rest of the limit would go the same way."""
    runs.service.settings.usage_factor = 12.0
    answer = runs.run(max_qpu_seconds=50)
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert "cut" in answer.err
    assert runs.call("resume", "last").code == 1
    assert runs.service.ledger().jobs == [job]
    shown = runs.call("runs", "show", "last", "--json").json()
    assert shown["qpu_seconds"] >= runs.service.ledger().charged_seconds
