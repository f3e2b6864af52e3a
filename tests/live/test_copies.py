"""Runs restored from older copies, and jobs of other runs: nothing is paid twice or taken over."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, number_of, played
from standin.service import Service

from qcompile.live.runs import find_journal


def copy_before_the_first_job(runs: Runs) -> Path:
    """A copy of a run before its first job was sent; the run itself continues to its end."""
    runs.service.settings.usage_limit_seconds = 1e9
    [folder] = Path("runs").iterdir()
    copy = Path("copies") / folder.name
    shutil.copytree(folder, copy)
    with find_journal(Path("copies"), folder.name) as journal:
        for table in ("submission", "charge", "step", "looked_over"):
            journal._db.do(f"DELETE FROM {table}")
        journal._db.do("UPDATE run SET result = NULL")
    return copy


def resumed(runs: Runs) -> Any:
    return runs.call("resume", "last", "--runs", "copies", "--json", "--yes")


def test_a_restored_copy_pays_for_nothing_again(runs: Runs, undisturbed: dict[str, Any]) -> None:
    first = runs.run().json()
    copy_before_the_first_job(runs)
    found = resumed(runs)
    assert found.code == 0, found.err
    assert played(found.json()) == played(first) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3
    assert found.json()["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)


def test_a_copy_looks_on_after_a_job_that_ibm_does_not_have(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    from qiskit_ibm_runtime import QiskitRuntimeService

    runs.run()
    copy_before_the_first_job(runs)
    QiskitRuntimeService().delete_job(runs.service.ledger().jobs[1].id)
    found = resumed(runs)
    assert found.code == 0, found.err
    assert played(found.json()) == undisturbed
    assert [number_of(job)[0] for job in runs.service.ledger().jobs] == [0, 1, 2, 1]


def test_a_copy_whose_charges_are_pending_is_counted_with_caps(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its journal has no caps of the jobs it finds, so IBM's are used: 19 s each."""
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.01,))
    runs.service.settings.usage_lag_seconds = 3600
    runs.run()
    copy_before_the_first_job(runs)
    for _ in range(2):
        found = resumed(runs)
        assert found.code == 0, found.err
        assert played(found.json()) == undisturbed
        assert (found.json()["qpu_seconds"], found.json()["jobs_uncharged"]) == (3 * 19, 3)
    runs.service.settings.usage_lag_seconds = 0
    assert resumed(runs).json()["qpu_seconds"] == pytest.approx(
        runs.service.ledger().charged_seconds
    )
    assert len(runs.service.ledger().jobs) == 3


def test_a_job_without_a_cap_of_ibms_gets_one_of_its_estimate(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """4 times 2.1792 s, rounded up, and 10 s."""
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.01,))
    runs.service.settings.usage_lag_seconds = 3600
    runs.run()
    copy_before_the_first_job(runs)
    real = Service.jobs

    def jobs(self: Service, query: Any, tags: Sequence[str]) -> Any:
        listed = real(self, query, tags)
        for job in listed["jobs"]:
            del job["cost"], job["created"]
        return listed

    monkeypatch.setattr(Service, "jobs", jobs)
    assert resumed(runs).json()["qpu_seconds"] == 3 * 19
    assert len(runs.service.ledger().jobs) == 3


@pytest.mark.parametrize("queue_s", [0.0, 3600.0])
def test_where_ibm_ignores_tags_no_job_of_another_run_is_taken_or_cancelled(
    runs: Runs, queue_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs.service.settings.queue_seconds = queue_s
    runs.run("--max-wait-seconds", 0.05, shots=64)
    before = runs.service.ledger()
    real = Service.jobs
    monkeypatch.setattr(Service, "jobs", lambda self, query, tags: real(self, query, ()))
    answer = runs.run()
    assert answer.code == 1
    assert (
        "Error: IBM's service lists jobs without the requested tag.\n"
        "  It is unclear which jobs belong to this run: none was used, cancelled or sent.\n"
    ) in answer.err
    after = runs.service.ledger()
    assert after.jobs == before.jobs
    assert "POST /jobs/{id}/cancel" not in after.requests


def test_a_job_with_the_tag_of_an_earlier_attempt_is_found_before_another_is_sent(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first attempt failed, but IBM has a second job of its tag, accepted without an answer."""
    from standin import Fault

    runs.service.faults.listing_lag_seconds = 3600
    runs.service.faults.once(Fault.ACCEPTED_504, on="POST /jobs")
    real, count = Service.submit, []

    def submit(self: Service, body: Any) -> Any:
        job = real(self, body)
        count.append(job)
        if len(count) == 2:
            job.fail()
            runs.service.faults.listing_lag_seconds = 0
        return job

    monkeypatch.setattr(Service, "submit", submit)
    monkeypatch.setattr("qcompile.live.sender.Sender._earliest", lambda self, made, job_id: job_id)
    found = runs.until_finished(runs.run())
    assert runs.errors == []
    assert played(found) == undisturbed
    assert [number_of(job) for job in runs.service.ledger().jobs] == [
        *((0, 0), (0, 0), (1, 0), (2, 0))
    ]
    assert found["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
