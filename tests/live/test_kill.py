"""A run that is killed at any moment resumes as if nothing had happened."""

from __future__ import annotations

import time
from typing import Any

import pytest
from live_runs import LIMIT_S, Runs, check_paid_once, killed, played

WORDS = (
    *("run", "cartpole", "--backend", "fake_lima", "--live", "--yes", "--json"),
    *("--shots", "256", "--episodes", "2", "--max-steps", "3", "--mitigation", "none"),
    *("--speculate", "1", "--max-qpu-seconds", f"{LIMIT_S:g}"),
)


@pytest.mark.parametrize(
    ("request_", "times", "pause_s"),
    [("POST /jobs", 1, 0.0), ("POST /jobs", 2, 0.05), ("GET /jobs/{id}/results", 2, 0.0)],
)
def test_a_killed_run_goes_on(
    runs: Runs, undisturbed: dict[str, Any], request_: str, times: int, pause_s: float
) -> None:
    """Killed as soon as the service has seen this many of these requests."""
    runs.service.settings.run_seconds = 0.1
    killed(runs.service, WORDS, request_, times, pause_s)
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert len(runs.service.ledger().jobs) == 3


def test_ctrl_c_stops_a_run_in_words(
    runs: Runs, undisturbed: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    runs.service.settings.run_seconds = 2.0  # longer than a slow machine takes to the first look
    real = time.sleep

    def interrupt(seconds: float) -> None:
        monkeypatch.setattr("qcompile.live.jobs.time.sleep", real)
        raise KeyboardInterrupt

    monkeypatch.setattr("qcompile.live.jobs.time.sleep", interrupt)
    answer = runs.run()
    runs.service.settings.run_seconds = 0.1
    assert answer.code == 1
    assert (
        "Error: Interrupted.\n  Jobs done: 0, steps played: 0; everything is kept.\n"
        "  `qcompile resume "
    ) in answer.err
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
