"""IBM batches, and the older sampler if the current one is not served; never a session."""

from __future__ import annotations

import sys
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, played
from standin import Fault
from standin.errors import ApiError
from standin.service import Service


def modes(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The modes of all sessions that the service is asked to open."""
    asked, real = [], Service.open_batch

    def open_batch(self: Service, body: Any) -> Any:
        asked.append(body["mode"])
        return real(self, body)

    monkeypatch.setattr(Service, "open_batch", open_batch)
    return asked


def without_executor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the service know no program "executor", as IBM's answers to an unknown program."""
    real = Service.submit

    def submit(self: Service, body: Any) -> Any:
        if body["program_id"] == "executor":
            raise ApiError(404, 1216, "Program not found: executor")
        return real(self, body)

    monkeypatch.setattr(Service, "submit", submit)


def test_jobs_alone_open_nothing(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = modes(monkeypatch)
    assert runs.run().code == 0
    assert asked == []
    assert {job.session_id for job in runs.service.ledger().jobs} == {None}
    assert {job.program_id for job in runs.service.ledger().jobs} == {"executor"}


def test_a_batch_holds_all_jobs_and_is_closed(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = modes(monkeypatch)
    answer = runs.run("--batch")
    assert answer.code == 0, answer.err
    assert played(answer.json()) == undisturbed
    assert asked == ["batch"]
    ledger = runs.service.ledger()
    [batch] = {job.session_id for job in ledger.jobs}
    assert batch is not None
    assert ledger.requests["PATCH /sessions/{id}"] == 1
    check_paid_once(runs.service, 3)


def test_a_batch_that_ended_is_followed_by_another(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = modes(monkeypatch)
    runs.service.settings.batch_seconds = 0.3
    runs.service.settings.run_seconds = 0.25
    found = runs.until_finished(runs.run("--batch"))
    assert played(found) == undisturbed
    assert len(asked) >= 2
    assert set(asked) == {"batch"}
    check_paid_once(runs.service, 3)


def test_a_batch_that_cannot_be_closed_keeps_the_run_from_nothing(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("qcompile.live.client_errors.PATIENCE_S", 0.1)
    runs.service.faults.chance(Fault.DROPPED, 1.0, on="PATCH /sessions/{id}")
    answer = runs.run("--batch")
    assert answer.code == 0, answer.err
    assert played(answer.json()) == undisturbed
    assert runs.service.ledger().faults[Fault.DROPPED] >= 1


@pytest.mark.parametrize("batch", [(), ("--batch",)])
def test_the_older_sampler_where_the_new_one_is_not_served(
    runs: Runs,
    undisturbed: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
    batch: tuple[str, ...],
) -> None:
    without_executor(monkeypatch)
    answer = runs.run(*batch)
    assert answer.code == 0, answer.err
    assert played(answer.json()) == undisturbed
    assert [job.program_id for job in runs.service.ledger().jobs] == ["sampler"] * 3
    assert runs.service.ledger().requests["POST /jobs"] == 4  # the new one is tried once
    check_paid_once(runs.service, 3)


def test_the_older_sampler_where_the_client_lacks_the_new_one(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "qiskit_ibm_runtime.executor_sampler", None)
    assert played(runs.run().json()) == undisturbed
    assert [job.program_id for job in runs.service.ledger().jobs] == ["sampler"] * 3
