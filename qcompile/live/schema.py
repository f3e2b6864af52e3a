"""The tables of a journal, and how those of earlier versions become what they are now."""

from __future__ import annotations

import sqlite3

from qcompile.limits import SECONDS_PER_EXECUTION, SECONDS_PER_JOB

FORMAT = "qcompile-journal-3"
SECOND_FORMAT = "qcompile-journal-2"
FIRST_FORMAT = "qcompile-journal-1"
FORMATS = (FORMAT, SECOND_FORMAT, FIRST_FORMAT)
"""The second lacks the table of what was measured: its jobs have `ones` instead. So has the first,
whose charges stand in other tables besides."""

_CHARGE = """(
  row INTEGER PRIMARY KEY, number INTEGER, executions INTEGER, cap_s REAL, sent_at TEXT,
  refused INTEGER, job_id TEXT UNIQUE, charged_s REAL
)"""
_MEASURED = """(
  number INTEGER, pub INTEGER, name TEXT, shape TEXT, width INTEGER, packed BLOB,
  PRIMARY KEY (number, pub, name)
)"""
_INDEXES = (
    "CREATE INDEX open_charge ON charge (row) WHERE charged_s IS NULL",
    "CREATE INDEX sent_submission ON submission (job_id) WHERE state = 'sent'",
)
_TABLES = (
    """CREATE TABLE run (
      format TEXT, id TEXT, kind TEXT, created TEXT, settings TEXT, versions TEXT,
      max_qpu_seconds REAL, result TEXT
    )""",
    """CREATE TABLE submission (
      number INTEGER, attempt INTEGER, tag TEXT UNIQUE, digest TEXT, executions INTEGER, state TEXT,
      sent_at TEXT, cap_s INTEGER, job_id TEXT, ones BLOB, words TEXT,
      PRIMARY KEY (number, attempt)
    )""",
    f"CREATE TABLE measured {_MEASURED}",
    f"CREATE TABLE charge {_CHARGE}",
    "CREATE TABLE looked_over (at TEXT)",
    "CREATE TABLE step (number INTEGER PRIMARY KEY, observations BLOB, actions BLOB, rewards BLOB)",
    *_INDEXES,
)
_CAP_S = f"4 * ({SECONDS_PER_JOB} + {SECONDS_PER_EXECUTION} * executions) + 10"
"""Of a job that the first version found by its tag, and gave no cap."""
_CHARGES_OF_FIRST_FORMAT = f"""
SELECT number, executions, ifnull(cap_s, {_CAP_S}), ifnull(sent_at, (SELECT created FROM run)),
  0, job_id, charged_s
FROM main.submission
WHERE state != 'intended' AND NOT (state = 'failed' AND job_id IS NULL)
UNION ALL
SELECT (SELECT number FROM main.submission WHERE 'doubt ' || tag = extra.job_id), executions,
  ifnull(cap_s, {_CAP_S}), (SELECT created FROM run), 0,
  CASE WHEN job_id LIKE 'doubt %' THEN NULL ELSE job_id END, charged_s
FROM main.extra
"""


def create(db: sqlite3.Connection) -> None:
    """Make the tables."""
    for statement in _TABLES:
        db.execute(statement)


def read_as_now(db: sqlite3.Connection, format_: str) -> None:
    """Have a journal of an earlier version read like one of today; its file stays as it is."""
    db.execute("PRAGMA temp_store = MEMORY")
    if format_ == FIRST_FORMAT:
        _fill(db, "temp")
    if format_ != FORMAT:
        db.execute(f"CREATE TABLE temp.measured {_MEASURED}")


def migrate(db: sqlite3.Connection) -> None:
    """Make a journal of an earlier version one of today, wholly or not at all."""
    for table in ("charge", "looked_over", "measured"):
        db.execute(f"DROP TABLE IF EXISTS temp.{table}")
    db.execute("BEGIN IMMEDIATE")
    try:
        [[format_]] = db.execute("SELECT format FROM run")
        if format_ == FIRST_FORMAT:  # and no other process was faster
            _fill(db, "main")
            for index in _INDEXES:
                db.execute(index)
            db.execute("DROP TABLE extra")
        if format_ != FORMAT:
            db.execute(f"CREATE TABLE main.measured {_MEASURED}")
            db.execute("UPDATE run SET format = ?", (FORMAT,))
        db.execute("COMMIT")
    except BaseException:
        db.execute("ROLLBACK")
        raise


def _fill(db: sqlite3.Connection, where: str) -> None:
    db.execute(f"CREATE TABLE {where}.charge {_CHARGE}")
    db.execute(f"CREATE TABLE {where}.looked_over (at TEXT)")
    db.execute(
        f"INSERT OR IGNORE INTO {where}.charge "
        "(number, executions, cap_s, sent_at, refused, job_id, charged_s) "
        f"{_CHARGES_OF_FIRST_FORMAT}"
    )
