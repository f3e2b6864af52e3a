"""Journals of version 0.1.0: read as they are, and resumed in the format of today."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_runs import Runs, check_paid_once, played

from qcompile.live.journal import Journal
from qcompile.live.records import to_bytes

SCHEMA = """
CREATE TABLE run (
  format TEXT, id TEXT, kind TEXT, created TEXT, settings TEXT, versions TEXT,
  max_qpu_seconds REAL, result TEXT
);
CREATE TABLE submission (
  number INTEGER, attempt INTEGER, tag TEXT UNIQUE, digest TEXT, executions INTEGER, state TEXT,
  sent_at TEXT, cap_s INTEGER, job_id TEXT, charged_s REAL, ones BLOB, words TEXT,
  PRIMARY KEY (number, attempt)
);
CREATE TABLE extra (job_id TEXT PRIMARY KEY, executions INTEGER, cap_s INTEGER, charged_s REAL);
CREATE TABLE step (number INTEGER PRIMARY KEY, observations BLOB, actions BLOB, rewards BLOB);
"""
"""That of version 0.1.0, literally."""
SENT_AT = "2026-01-02T03:04:05+00:00"
SUBMISSIONS = [
    (0, 0, "failed", 5, "job-a", 1.5, None),
    (0, 1, "done", 6, "job-b", 2.25, to_bytes(np.array([[3, 5]]))),
    (1, 0, "done", 7, "job-c", None, to_bytes(np.array([[4, 6]]))),
    (2, 0, "sent", None, "job-d", None, None),  # found by its tag: it had no cap
    (3, 0, "failed", 8, None, 0.0, None),  # refused, and never a job
    (4, 0, "sending", 9, None, None, None),
    (5, 0, "intended", None, None, None, None),
]
EXTRAS = [("job-x", 100, 6, 0.5), ("doubt qcompile-old-4-0", 100, 9, None)]


def old() -> Path:
    """A journal with every kind of row, each of 100 executions."""
    folder = Path("runs") / "old"
    folder.mkdir(parents=True)
    with sqlite3.connect(folder / "journal.sqlite") as db:
        db.executescript(SCHEMA)
        run = ("qcompile-journal-1", "old", "run", SENT_AT, "{}", "{}", 60.0, None)
        db.execute("INSERT INTO run VALUES (?,?,?,?,?,?,?,?)", run)
        for number, attempt, state, cap_s, job_id, charged_s, ones in SUBMISSIONS:
            tag = f"qcompile-old-{number}-{attempt}"
            sent_at = None if state == "intended" else SENT_AT
            db.execute(
                "INSERT INTO submission VALUES (?,?,?,?,?,?,?,?,?,?,?,?)",
                (
                    *(number, attempt, tag, "d", 100, state, sent_at, cap_s, job_id, charged_s),
                    *(ones, None),
                ),
            )
        db.executemany("INSERT INTO extra VALUES (?,?,?,?)", EXTRAS)
    db.close()
    return folder


def check(journal: Journal) -> None:
    """Estimated at 2.035 s, the job without a cap gets 4 times that and 10 s."""
    charges = journal.charges
    assert charges.settled_s == 1.5 + 2.25 + 0.5
    assert charges.upper_s == pytest.approx(1.5 + 2.25 + 0.5 + 7 + 18.14 + 9 + 9)
    assert [charge.job_id for charge in charges.uncharged()] == ["job-c"]
    assert [(doubt.number, doubt.cap_s) for doubt in charges.doubts()] == [(4, 9), (4, 9)]
    assert charges.worst_ratio == pytest.approx(2.25 / 2.035)
    assert journal.jobs_done() == 2
    states = [(made.state, made.charged_s) for made in journal.submissions()]
    assert states == [(row[2], row[5] if row[4] else None) for row in SUBMISSIONS]
    assert not journal.charges.are_settled


def test_one_is_read_without_being_changed() -> None:
    path = old() / "journal.sqlite"
    before = hashlib.sha256(path.read_bytes()).hexdigest()
    for _ in range(2):
        with Journal(path.parent) as journal:
            check(journal)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == before


def test_one_that_is_resumed_holds_what_it_held() -> None:
    folder = old()
    with Journal(folder) as reading, Journal(folder) as journal:
        check(reading)
        with journal.held():
            check(journal)
            journal.note_sending(journal.intend(6, "d", 100), 3)
        with journal.held():
            assert len(journal.charges.doubts()) == 3
    with Journal(folder) as journal:
        assert [doubt.cap_s for doubt in journal.charges.doubts()] == [9, 9, 3]
    with sqlite3.connect(folder / "journal.sqlite") as db:
        tables = {name for (name,) in db.execute("SELECT name FROM sqlite_master")}
        assert db.execute("SELECT format FROM run").fetchone() == ("qcompile-journal-3",)
    assert "charge" in tables
    assert "extra" not in tables


def as_of_first_version(path: Path) -> None:
    """Write today's journal as version 0.1.0 would have."""
    with sqlite3.connect(path) as db:
        rows = db.execute(
            "SELECT s.number, attempt, tag, digest, s.executions, state, s.sent_at, s.cap_s, "
            "s.job_id, charged_s, ones, words "
            "FROM submission AS s LEFT JOIN charge ON charge.job_id = s.job_id"
        ).fetchall()
        db.execute("DROP TABLE submission")
        db.execute("DROP TABLE charge")
        db.execute("DROP TABLE looked_over")
        db.executescript(
            SCHEMA[SCHEMA.index("CREATE TABLE submission") : SCHEMA.index("CREATE TABLE step")]
        )
        db.executemany("INSERT INTO submission VALUES (?,?,?,?,?,?,?,?,?,?,?,?)", rows)
        db.execute("UPDATE run SET format = 'qcompile-journal-1'")
    db.close()


def test_a_run_of_it_goes_on_where_it_stopped(runs: Runs, undisturbed: dict[str, Any]) -> None:
    runs.service.settings.usage_factor = 1.5
    assert runs.run(max_qpu_seconds=9).code == 1  # after two of three jobs
    [path] = Path("runs").glob("*/journal.sqlite")
    as_of_first_version(path)
    [row] = runs.call("runs", "--json").json()
    charged_s = runs.service.ledger().charged_seconds
    assert (row["jobs_done"], row["qpu_seconds"]) == (2, pytest.approx(charged_s))
    found = runs.call("resume", "last", "--max-qpu-seconds", 11, "--yes", "--json")
    assert found.code == 0, found.err
    assert played(found.json()) == undisturbed
    check_paid_once(runs.service, 3, 11)
    assert found.json()["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
    assert json.loads(found.out)["jobs_in_doubt"] == 0
