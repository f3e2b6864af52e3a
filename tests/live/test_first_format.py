"""Journals of version 0.1.0: read unchanged, and resumed in the current format."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_runs import Runs, check_paid_once, played
from qiskit import QuantumCircuit
from qiskit.circuit import Parameter
from qiskit.primitives import BitArray

from qcompile.live.journal import Journal
from qcompile.live.old_counts import bits_of_ones
from qcompile.live.pubs import Call
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
        with journal.locked():
            check(journal)
            journal.note_sending(journal.intend(6, "d", 100), 3)
        with journal.locked():
            assert len(journal.charges.doubts()) == 3
    with Journal(folder) as journal:
        assert [doubt.cap_s for doubt in journal.charges.doubts()] == [9, 9, 3]
    with sqlite3.connect(folder / "journal.sqlite") as db:
        tables = {name for (name,) in db.execute("SELECT name FROM sqlite_master")}
        assert db.execute("SELECT format FROM run").fetchone() == ("qcompile-journal-3",)
    assert "charge" in tables
    assert "extra" not in tables


def ones_of(shape: str, width: int, packed: bytes) -> bytes:
    """The ones (rows, bits) of a register, as an array of version 0.1.0."""
    array = np.frombuffer(packed, np.uint8).reshape(*json.loads(shape), -1)
    bits = BitArray(array, width).to_bool_array(order="little")
    return to_bytes(bits.sum(axis=1, dtype=np.int64))


def with_ones(path: Path, *, version: int) -> None:
    """Rewrite a current journal of one-round jobs in that format: ones, and another digest."""
    with sqlite3.connect(path) as db:
        for number, *register in db.execute("SELECT number, shape, width, packed FROM measured"):
            if register[2] is not None:
                ones = ones_of(*register)
                db.execute("UPDATE submission SET ones = ? WHERE number = ?", (ones, number))
        db.execute("UPDATE submission SET digest = 'of another kind'")
        db.execute("DROP TABLE measured")
        db.execute("UPDATE run SET format = ?", (f"qcompile-journal-{version}",))
    db.close()


def as_of_first_version(path: Path) -> None:
    """Rewrite a current journal as version 0.1.0 would have written it."""
    with_ones(path, version=1)
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
    db.close()


@pytest.mark.parametrize("state", ["unfinished", "finished"])
def test_a_run_of_the_second_format_goes_on_where_it_stopped(
    runs: Runs, undisturbed: dict[str, Any], state: str
) -> None:
    """Its counts are read and kept unchanged, and its finished result is returned again."""
    if state == "unfinished":  # after two of three jobs
        runs.service.settings.usage_factor = 1.5
    runs.run(max_qpu_seconds=9)
    [path] = Path("runs").glob("*/journal.sqlite")
    with_ones(path, version=2)
    before = hashlib.sha256(path.read_bytes()).hexdigest()
    jobs = runs.call("runs", "export", "last").json()["jobs"]
    assert [np.shape(job["ones"]) for job in jobs if job["state"] == "done"] == [(2, 4)] * (
        2 if state == "unfinished" else 3
    )
    assert hashlib.sha256(path.read_bytes()).hexdigest() == before
    found = runs.call("resume", "last", "--max-qpu-seconds", 60, "--yes", "--json")
    assert found.code == 0, found.err
    assert played(found.json()) == undisturbed
    check_paid_once(runs.service, 3)
    if state == "finished":  # it is played again, from its ones
        with sqlite3.connect(path) as db:
            db.execute("UPDATE run SET result = NULL")
        db.close()
        assert played(runs.call("resume", "last", "--json").json()) == undisturbed


@pytest.mark.parametrize(
    "ones",
    [
        np.zeros((8, 4), np.int64),
        np.zeros((1, 1), np.int64),
        np.full((2, 4), -1),
        np.full((2, 4), 257),
        np.full((2, 4), np.nan),
    ],
)
def test_ones_that_cannot_be_are_explained(runs: Runs, ones: np.ndarray[Any, Any]) -> None:
    """Two CartPole episodes at 256 shots have counts (2, 4) in [0, 256]."""
    assert runs.run().code == 0
    [path] = Path("runs").glob("*/journal.sqlite")
    with_ones(path, version=2)
    with sqlite3.connect(path) as db:
        db.execute("UPDATE run SET result = NULL")
        db.execute("UPDATE submission SET ones = ? WHERE number = 1", (to_bytes(ones),))
    db.close()
    answer = runs.call("resume", "last")
    assert answer.code == 1
    words = "is damaged: the counts of a job are not valid.\n  Restore a backup.\n"
    assert f"Error: {path} {words}" in answer.err
    assert len(runs.service.ledger().jobs) == 3


def test_bits_of_ones_have_those_ones(runs: Runs) -> None:
    """Rounds of several circuits, in any order: each circuit keeps its own."""
    metadata = [{"circuits": [1, 4, 9]}, {"circuits": [0, 2, 3, 5, 6, 7, 8, 10, 11]}]
    pubs = []
    for more in metadata:
        circuit = QuantumCircuit(1, len(more["circuits"]), metadata=more)
        circuit.rz(Parameter("x"), 0)
        pubs.append((circuit, np.zeros((3, 1))))
    (request,) = Call(pubs, 50).requests
    ones = np.random.default_rng(0).integers(0, 51, (3, 12))
    for register, more in zip(bits_of_ones(ones, request), metadata, strict=True):
        array = BitArray(register.bits, register.width).to_bool_array(order="little")
        np.testing.assert_array_equal(array.sum(axis=1), ones[:, more["circuits"]])


def test_ones_of_wide_circuits_are_no_counts_of_it(runs: Runs) -> None:
    """Version 0.1.0 had none: one column for a register of two bits is damage."""
    circuit = QuantumCircuit(2, 2, metadata={"circuits": [0], "bits": [0, 1]})
    (request,) = Call([circuit], 50).requests
    with pytest.raises(ValueError, match="circuits of several qubits"):
        bits_of_ones(np.array([[3]]), request)


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
