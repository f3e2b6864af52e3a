"""Which jobs of a run are found at IBM, used, counted and cancelled."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from qcompile.live.answers import RemoteJob
from qcompile.live.finder import Finder, settles_at
from qcompile.live.journal import Journal
from qcompile.live.records import Charge


class Service:
    """Lists its jobs by their tags, and notes which are cancelled."""

    def __init__(self) -> None:
        self.jobs: list[RemoteJob] = []
        self.cancelled: list[str] = []

    def add(self, job_id: str, tag: str, status: str, created: str, cap_s: int | None) -> None:
        answer = {
            "id": job_id,
            "tags": ["qcompile", tag],
            "created": created,
            "cost": cap_s,
            "state": {"status": status},
        }
        self.jobs.append(RemoteJob.model_validate(answer))

    def listed(self, tag: str, since: datetime | None = None) -> list[RemoteJob]:
        return [job for job in self.jobs if tag in (job.tags or ())]

    def cancel(self, job_id: str) -> None:
        self.cancelled.append(job_id)


@pytest.fixture
def journal() -> Journal:
    return Journal.create(Path("runs"), "run", "cart", {}, {}, 100.0)


@pytest.fixture
def service() -> Service:
    return Service()


@pytest.fixture
def finder(journal: Journal, service: Service) -> Finder:
    return Finder(journal, service, 0.0, lambda words: None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("setting", "unanswered_s", "refused_s"),
    [(None, 3600, 60), ("600", 600, 60), ("30", 30, 30)],
)
def test_a_doubt_stands_for_an_hour_and_after_a_refusal_for_a_minute(
    setting: str | None, unanswered_s: float, refused_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    if setting is not None:
        monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", setting)
    sent_at = datetime(2026, 1, 2, 23, 30, tzinfo=UTC)
    for refused, seconds in ((False, unanswered_s), (True, refused_s)):
        doubt = Charge(1, 0, 10, 9.0, sent_at, refused, None, None)
        assert settles_at(doubt) - sent_at == timedelta(seconds=seconds)


def test_a_job_that_does_not_say_its_cap_may_be_the_one_of_the_longest(
    journal: Journal, service: Service, finder: Finder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sent with 9 s and with 15 s: one is listed, the other was not accepted in the end."""
    made = journal.intend(0, "d", 10)
    for cap_s in (9, 15):
        journal.note_sending(made, cap_s)
    service.add("job-a", made.tag, "Running", "2026-01-02T00:00:00Z", None)
    assert finder.find(made) == "job-a"
    assert journal.charges.upper_s >= 9 + 15
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "0")
    finder.reconcile()
    assert journal.charges.doubts() == []
    assert journal.charges.upper_s == 15


def job_of(journal: Journal, service: Service, finder: Finder, *states: str) -> Any:
    """The job that is used of several, given oldest first, and those that are cancelled."""
    made = journal.intend(0, "d", 10)
    for number, status in enumerate(states):
        journal.note_sending(made, 9)
        service.add(f"job-{number}", made.tag, status, f"2026-01-02T00:00:0{number}Z", 9)
    service.jobs.reverse()
    return finder.find(made), sorted(service.cancelled)


@pytest.mark.parametrize(
    ("states", "taken", "cancelled"),
    [
        (("Queued", "Completed"), "job-1", ["job-0"]),
        (("Running", "Queued"), "job-0", ["job-1"]),
        (("Failed", "Running"), "job-1", []),
        (("Failed", "Completed", "Completed"), "job-1", []),
        (("Failed", "Failed"), "job-0", []),
    ],
)
def test_of_several_jobs_one_with_counts_is_taken_then_one_that_may_have_some_then_the_first(
    states: tuple[str, ...],
    taken: str,
    cancelled: list[str],
    journal: Journal,
    service: Service,
    finder: Finder,
) -> None:
    assert job_of(journal, service, finder, *states) == (taken, cancelled)
    assert journal.charges.upper_s == 9 * len(states)
