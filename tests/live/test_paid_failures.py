"""Charged jobs without counts are sent again only with permission."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs, played
from standin.service import Service

STEP_S = 2.1792


def fail_charged(
    runs: Runs, monkeypatch: pytest.MonkeyPatch, *calls: int, outcome: str = "Failed"
) -> None:
    """Let the jobs with these numbers, from 0, end without counts and be charged all the same."""
    real, count = Service.submit, itertools.count()

    def submit(self: Service, body: Any) -> Any:
        job = real(self, body)
        if next(count) in calls:
            job.outcome, job.reason, job.reason_code = outcome, "A qubit was hot.", 9701
        return job

    monkeypatch.setattr(Service, "submit", submit)


@pytest.mark.parametrize("outcome", ["Failed", "Cancelled"])
@pytest.mark.parametrize("lag_s", [0.0, 3600.0])
def test_one_ends_the_run_and_is_sent_again_on_request(
    runs: Runs,
    undisturbed: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
    outcome: str,
    lag_s: float,
) -> None:
    """Whether IBM has already reported the charge, or may still do so."""
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.01,))
    runs.service.settings.usage_lag_seconds = lag_s
    fail_charged(runs, monkeypatch, 0, outcome=outcome)
    answer = runs.run()
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert job.charged_seconds == pytest.approx(STEP_S)
    charge = "may still be charged" if lag_s else "was charged 2.1792 s"
    assert f"  It {charge}; this was attempt 1.\n" in answer.err
    [folder] = Path("runs").iterdir()
    for more in ((), ("--max-qpu-seconds", 60), ("--max-qpu-seconds", 59)):
        answer = runs.call("resume", "last", *more)
        assert answer.code == 1
        assert answer.err.endswith(
            f"Error: Job {job.id} returned no counts. IBM says: A qubit was hot. (code 9701)\n"
            f"  It {charge}. It is sent and paid for again only if you allow it.\n"
            "  Jobs done: 0, steps played: 0; everything is kept.\n"
            f"  `qcompile resume {folder.name} --yes` sends it again.\n"
        )
    assert len(runs.service.ledger().jobs) == 1
    runs.service.settings.usage_lag_seconds = 0
    found = runs.until_finished(runs.call("resume", "last", "--json", "--yes"))
    assert runs.errors == []
    assert played(found) == undisturbed
    ledger = runs.service.ledger()
    assert len(ledger.jobs) == 4
    assert found["qpu_seconds"] == pytest.approx(ledger.charged_seconds) == 4 * STEP_S


def test_a_yes_is_for_one_failure(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second that happens in the same call ends it again."""
    fail_charged(runs, monkeypatch, 0, 1, 2)
    assert runs.run().code == 1
    for jobs in (2, 3):
        assert runs.call("resume", "last", "--yes").code == 1
        assert len(runs.service.ledger().jobs) == jobs
    assert runs.call("resume", "last").code == 1
    assert len(runs.service.ledger().jobs) == 3


def test_a_job_that_was_cut_off_does_not_take_the_rest_unasked(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """19 of 100 s are spent; `resume` asks before it spends more of them on the same job."""
    runs.service.settings.usage_factor = 9.0
    answer = runs.run(max_qpu_seconds=100)
    assert answer.code == 1
    [job] = runs.service.ledger().jobs
    assert f"Error: IBM stopped job {job.id} at 19 s.\n" in answer.err
    assert runs.call("resume", "last").code == 1
    assert len(runs.service.ledger().jobs) == 1
    runs.service.settings.usage_factor = 1.0
    found = runs.call("resume", "last", "--max-qpu-seconds", 110, "--yes", "--json").json()
    assert played(found) == undisturbed
    assert found["qpu_seconds"] == pytest.approx(19 + 3 * STEP_S)


@pytest.mark.parametrize("said", ["y\n", "n\n"])
def test_somebody_at_a_terminal_is_asked(
    runs: Runs, monkeypatch: pytest.MonkeyPatch, said: str
) -> None:
    import io

    fail_charged(runs, monkeypatch, 0)
    assert runs.run().code == 1
    monkeypatch.setattr("sys.stdin", io.StringIO(said))
    monkeypatch.setattr("qcompile.cli.resume.is_interactive", lambda: True)
    answer = runs.call("resume", "last")
    assert "It is sent and paid for again only if you allow it." in answer.err
    assert "Send it again? [y/N]" in answer.err
    assert answer.code == (said == "n\n")
    assert len(runs.service.ledger().jobs) == (1 if answer.code else 4)


@pytest.mark.parametrize("limit", ["inf", "nan", "-1", "-inf", "0", "1e7"])
def test_a_limit_that_cannot_be_kept_is_refused(runs: Runs, limit: str) -> None:
    runs.service.settings.usage_factor = 1.5
    assert runs.run(max_qpu_seconds=limit).code == 2
    assert not runs.service.ledger().jobs
    assert runs.run(max_qpu_seconds=9).code == 1
    assert runs.call("resume", "last", "--yes", "--max-qpu-seconds", limit).code == 2
    [row] = runs.call("runs", "--json").json()
    assert row["max_qpu_seconds"] == 9
