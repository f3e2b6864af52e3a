"""Each known trouble of the service: same result, nothing lost, no charge unreported."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from live_ledger import (
    charged_of_steps,
    charged_s,
    jobs_of,
    secrets_in,
    settled_wrong,
    told_wrong,
    words_wrong,
)
from live_runs import Runs, played
from standin import TROUBLES, StandIn, Trouble

_IN_TROUBLE, _MOST = 3, 8
_BATCHES = "shape: batch"


@pytest.fixture(autouse=True)
def short_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Doubts last for the whole of a test; all other waits are short."""
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "600")
    monkeypatch.setattr("qcompile.live.client_errors.PATIENCE_S", 0.3)
    monkeypatch.setattr("qcompile.live.billing._CHARGE_PAUSES_S", (0.02, 0.02))
    monkeypatch.setattr("qcompile.live.jobs._FETCH_PAUSE_S", 0.01)


@dataclass
class Books:
    """A small run, whose reports are checked against the service's ledger after each command."""

    runs: Runs
    limit_s: float
    wrong: list[str] = field(default_factory=list)
    stops: int = 0
    doubted: bool = False

    @property
    def service(self) -> StandIn:
        return self.runs.service

    @property
    def run(self) -> str | None:
        """The id of the only run, once it has begun."""
        return next((path.parent.name for path in Path("runs").glob("*/journal.sqlite")), None)

    def result(self, trouble: Trouble) -> dict[str, Any] | None:
        """The result of the run, resumed as often as needed: first with trouble, then without.

        A requested traceback does not count as a fault.
        """
        for attempt in range(_MOST):
            if attempt == _IN_TROUBLE:
                self.service.recover()
            answer = self._next(trouble, attempt)
            if not (trouble.options and "qcompile.errors." in answer.err):
                self.wrong += words_wrong(answer.err)
            Path(f"err{attempt}").write_text(answer.err)
            self.compare()
            if answer.code == 0:
                return dict(answer.json())
            if answer.code != 1 or "Error: " not in answer.err:
                self.wrong.append(f"no words of what failed: {answer.err[-300:]!r}")
            self.stops += 1
        return None

    def _next(self, trouble: Trouble, attempt: int) -> Any:
        words = ("--batch",) if trouble.name.startswith(_BATCHES) else ()
        if self.run is None:
            return self.runs.run(*words, max_qpu_seconds=self.limit_s)
        more = ("--max-qpu-seconds", 1000) if attempt > _IN_TROUBLE else ()
        self.limit_s = 1000.0 if more else self.limit_s
        return self.runs.call("resume", self.run, "--yes", "--json", *more)

    def compare(self) -> None:
        """The run's report, with the ledger just before it."""
        if self.run is None:
            return
        charged = charged_s(jobs_of(self.service, self.run))
        told = self.runs.call("runs", "show", self.run, "--json").json()
        self.doubted = self.doubted or told["jobs_in_doubt"] > 0
        self.wrong += told_wrong(told, charged, 1e9 if self.doubted else self.limit_s)

    def settle(self) -> dict[str, Any]:
        """The result again, once everything is listed and reported: the books agree exactly."""
        assert self.run is not None
        self.service.recover()
        told = dict(self.runs.call("resume", self.run, "--yes", "--json").json())
        self.wrong += settled_wrong(told, charged_s(jobs_of(self.service, self.run)))
        return told


def neighbours(runs: Runs) -> dict[str, Any]:
    """The jobs of two other runs of the account, one that waits and one that has ended."""
    for shots, queue_s in ((100, 0.0), (300, 3600.0)):
        runs.service.settings.queue_seconds = queue_s
        runs.run("--runs", "neighbours", "--max-wait-seconds", 0.05, shots=shots, max_steps=1)
    runs.service.recover()
    return {job.id: job for job in runs.service.ledger().jobs}


@pytest.mark.parametrize("name", TROUBLES)
def test_the_books(
    runs: Runs, undisturbed: dict[str, Any], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    trouble = TROUBLES[name]
    were = neighbours(runs) if trouble.neighbours else {}
    runs.service.faults.seed(1648)
    trouble.begin(runs.service)
    _hasten(runs.service)
    books = Books(runs, trouble.limit_s or 300.0)
    result = books.result(trouble)
    assert result is not None
    if trouble.finishes:
        assert books.stops == 0
    monkeypatch.setenv("QCOMPILE_DOUBT_SECONDS", "0")
    again = books.settle()
    assert books.wrong == []
    assert runs.service.ledger().faults or name.startswith("charge: ")
    assert played(result) == played(again) == undisturbed
    charged = charged_of_steps(jobs_of(runs.service, books.run or ""))
    assert set(charged) == {0, 1, 2}
    assert all(charged.values())
    if trouble.paid_once:
        assert [len(seconds) for seconds in charged.values()] == [1, 1, 1]
    now = {job.id: job for job in runs.service.ledger().jobs}
    assert {job_id: now[job_id] for job_id in were} == were
    assert runs.service.ledger().requests.get("GET /jobs", 0) < 200
    assert secrets_in(Path("..").resolve(), runs.service) == []


def _hasten(service: StandIn) -> None:
    """Shorten all delays to a tenth."""
    service.faults.listing_lag_seconds /= 10
    service.faults.wait_seconds = 0.1
    service.settings.usage_lag_seconds /= 10
    service.faults.retry_after_seconds = 0


def test_the_comparison_can_fail() -> None:
    """Possible reports of a run when 4 s are charged and 3 s are allowed."""
    told = {"qpu_seconds": 5.0, "qpu_seconds_settled": 4.0, "jobs_in_doubt": 1}
    told["jobs_uncharged"] = 0
    assert told_wrong(told, 4.0, 3.0) == []
    assert told_wrong(told | {"jobs_in_doubt": 0}, 4.0, 3.0) == [
        "4.00 s charged with a limit of 3 s and no doubt told"
    ]
    assert told_wrong(told | {"qpu_seconds": 3.9, "qpu_seconds_settled": 0.0}, 4.0, 3.0) == [
        "told 3.90 s where 4.00 s are charged"
    ]
    assert told_wrong(told | {"qpu_seconds_settled": 5.1}, 4.0, 3.0) == ["settled 5.10 s of 5.00 s"]
    nan = told_wrong(json.loads('{"qpu_seconds": NaN, "jobs_in_doubt": 0}'), 4.0, 5.0)
    assert "told nan s where 4.00 s are charged" in nan
    assert len(settled_wrong(told, 4.0)) == 2
    assert words_wrong("plain\n\ttext") == []
    assert words_wrong("a\x1b[31m") == ["control characters: [\"'\\\\x1b'\"]"]
    assert words_wrong("a\u202e") == ["control characters: [\"'\\\\u202e'\"]"]
