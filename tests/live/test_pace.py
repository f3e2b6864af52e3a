"""Jobs are sent no faster than allowed, by option and by Retry-After."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs, check_paid_once, played
from standin import Fault, StandIn

from qcompile.live.client_errors import duration
from qcompile.live.connection import Connection
from qcompile.live.progress import Queue, Remaining
from qcompile.live.runs import find_journal

SUBMIT, JOB = "POST /jobs", "GET /jobs/{id}"


@pytest.fixture
def minute(service: StandIn, monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Make a minute last this long, on both sides."""
    monkeypatch.setattr("qcompile.live.pace._LATE_S", 0.5)

    def last(seconds: float) -> None:
        monkeypatch.setattr("qcompile.live.pace.MINUTE_S", seconds)
        service.settings.minute_seconds = seconds

    last(600.0)
    return last


def sent_at(service: StandIn) -> list[float]:
    return [datetime.fromisoformat(job.created).timestamp() for job in service.ledger().jobs]


def test_jobs_are_paced_from_one_process_to_the_next_and_never_refused(
    runs: Runs, undisturbed: dict[str, Any], minute: Callable[[float], None]
) -> None:
    runs.service.settings.jobs_per_minute = 2
    stopped = runs.run("--jobs-per-minute", 2, "--max-wait-seconds", 30)
    assert stopped.code == 1
    assert "Error: The next job can be sent in 10 min.\n  Nothing is lost: resume then.\n" in (
        stopped.err
    )
    first, _ = sent_at(runs.service)
    long_s = time.time() - first + 1.0
    minute(long_s)
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert runs.errors == []
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert sent_at(runs.service)[-1] - first >= long_s
    assert "too_many_jobs" not in runs.service.ledger().faults


@pytest.mark.usefixtures("minute")
def test_another_pace_when_resumed(runs: Runs) -> None:
    assert runs.run("--jobs-per-minute", 1, "--max-wait-seconds", 30).code == 1
    assert runs.call("resume", "last", "--jobs-per-minute", 9, "--json").code == 0
    first, *_, third = sent_at(runs.service)
    assert third - first < 600


def test_a_job_is_not_sent_again_before_the_time(runs: Runs, undisturbed: dict[str, Any]) -> None:
    """The service says a date."""
    runs.service.faults.retry_after_seconds = 2
    runs.service.faults.retry_after_is_a_date = True
    runs.service.faults.once(Fault.RATE_LIMITED, on=SUBMIT)
    began = time.time()
    found = runs.until_finished(runs.run())
    assert runs.errors == []
    assert played(found) == undisturbed
    check_paid_once(runs.service, 3)
    assert sent_at(runs.service)[0] - began >= 2
    assert found["jobs_in_doubt"] == 1  # a refusal may have been none
    assert found["qpu_seconds"] > found["qpu_seconds_settled"]


def test_more_jobs_than_a_minute_takes_are_sent_in_the_next(runs: Runs) -> None:
    """The client does not know the service's limit."""
    runs.service.settings.jobs_per_minute, runs.service.settings.minute_seconds = 1, 1.0
    assert runs.run("--max-steps", 2).code == 0
    assert len(runs.service.ledger().jobs) == 2


def test_a_job_that_is_unavailable_for_long_is_explained_and_not_sent(runs: Runs) -> None:
    runs.service.faults.retry_after_seconds = 7200
    runs.service.faults.once(Fault.UNAVAILABLE, on=SUBMIT)
    stopped = runs.run()
    assert stopped.code == 1
    assert "Error: The next job can be sent in 2 h 0 min.\n" in stopped.err
    assert runs.service.ledger().requests[SUBMIT] == 1


def test_what_is_read_is_not_asked_again_before_the_time(runs: Runs) -> None:
    runs.service.faults.retry_after_seconds = 1
    runs.service.faults.once(Fault.RATE_LIMITED, on=JOB)
    began = time.monotonic()
    assert runs.run("--max-steps", 1).code == 0
    assert time.monotonic() - began >= 1


@pytest.mark.parametrize("on", [JOB, "GET /instances/usage"])
def test_a_service_that_is_busy_for_long_is_explained(on: str, runs: Runs) -> None:
    runs.service.faults.retry_after_seconds = 900
    runs.service.faults.once(Fault.UNAVAILABLE, on=on)
    began = time.monotonic()
    stopped = runs.run()
    assert time.monotonic() - began < 60
    assert "Error: IBM's service is busy and asks to be called again in 15 min.\n" in stopped.err
    assert "  Nothing is lost: resume then.\n" in stopped.err


def test_an_interrupt_in_a_wait_stops_cleanly(runs: Runs) -> None:
    runs.service.faults.retry_after_seconds = 600
    runs.service.faults.once(Fault.RATE_LIMITED, on=SUBMIT)

    def interrupt() -> None:
        while not runs.service.ledger().faults:
            time.sleep(0.01)
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    stopped = runs.run()
    assert stopped.code == 1
    assert "Error: Interrupted.\n  Jobs done: 0" in stopped.err
    assert runs.service.ledger().jobs == []
    with find_journal(Path("runs"), "last") as journal:
        assert journal.home("last").process is None  # the lock is given back


def test_the_queue_is_told_after_a_while(
    service: StandIn, monkeypatch: pytest.MonkeyPatch, runs: Runs
) -> None:
    service.settings.queue_seconds = 60.0
    for _ in range(2):
        assert runs.run("--max-wait-seconds", 0.1).code == 1
    queue = Queue(Connection("fake_lima"))
    assert queue.words(0.0) == ""
    assert queue.words(6.0) == "2 jobs in the queue"
    asked = service.ledger().requests["GET /backends/{id}/status"]
    assert queue.words(7.0) == "2 jobs in the queue"
    assert service.ledger().requests["GET /backends/{id}/status"] == asked


def test_the_time_to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    remaining = Remaining(60, before=10)
    assert remaining.words(10) == ""
    now += 30
    assert remaining.words(20) == "about 2 min left"  # 40 more, of 3 s each
    paced = Remaining(60, before=10, job_s=12.0)
    assert paced.words(20) == "about 8 min left"
    assert paced.words(60) == ""
    assert paced.words(61) == "more jobs than planned"
    assert Remaining(1, before=1).words(1) == ""


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "1 s"), (99, "99 s"), (100, "2 min"), (3600, "1 h 0 min"), (7801, "2 h 11 min")],
)
def test_durations_are_rounded_up(seconds: float, words: str) -> None:
    assert duration(seconds) == words
