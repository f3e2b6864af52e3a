"""The tables of a journal, and the migration from earlier versions."""

from __future__ import annotations

import sqlite3

from qcompile.limits import SECONDS_PER_EXECUTION, SECONDS_PER_JOB

FORMAT = "qcompile-journal-3"
SECOND_FORMAT = "qcompile-journal-2"
FIRST_FORMAT = "qcompile-journal-1"
FORMATS = (FORMAT, SECOND_FORMAT, FIRST_FORMAT)
"""The second format lacks the table `measured`: its jobs have `ones` instead. So does the first,
which also keeps charges in other tables."""

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
"""The cap of a job that the first version found by its tag without recording one."""
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
    """Create the tables."""
    for statement in _TABLES:
        db.execute(statement)


def read_as_now(db: sqlite3.Connection, format_: str) -> None:
    """Make a journal of an earlier version readable as a current one, without changing its file."""
    db.execute("PRAGMA temp_store = MEMORY")
    if format_ == FIRST_FORMAT:
        _fill(db, "temp")
    if format_ != FORMAT:
        db.execute(f"CREATE TABLE temp.measured {_MEASURED}")


def migrate(db: sqlite3.Connection) -> None:
    """Migrate a journal of an earlier version to the current format, whole or not at all."""
    for table in ("charge", "looked_over", "measured"):
        db.execute(f"DROP TABLE IF EXISTS temp.{table}")
    db.execute("BEGIN IMMEDIATE")
    try:
        [[format_]] = db.execute("SELECT format FROM run")
        if format_ == FIRST_FORMAT:  # unless another process was faster
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
