"""The file of a journal: created whole or not at all, and checked before it is used.

It may be damaged, or come from somebody else. A file that passes has the tables, columns and types
of a journal, and nothing that SQLite would execute.
"""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from qcompile.errors import LiveError
from qcompile.live import schema
from qcompile.output import sync
from qcompile.reading import load_json
from qcompile.terminal import one_line

FILE = "journal.sqlite"
_RESTORE = "Copy the run to a writable folder; if it is damaged, restore it from a backup."

_NUMBER = "typeof({0}) IN ('integer', 'real') AND abs({0}) < 1e12"
_COUNT = "typeof({0}) = 'integer' AND {0} >= 0"
_TEXT = "typeof({0}) = 'text'"
_BLOB = "typeof({0}) = 'blob'"
_STATES = "'intended', 'sending', 'sent', 'done', 'failed'"
_RIGHT = {
    "run": {
        "settings": _TEXT,
        "versions": _TEXT,
        "max_qpu_seconds": "typeof({0}) IN ('integer', 'real') AND {0} >= 0",
        "result": f"{{0}} IS NULL OR {_TEXT}",
    },
    "submission": {
        "number": _COUNT,
        "attempt": _COUNT,
        "tag": _TEXT,
        "digest": _TEXT,
        "executions": _COUNT,
        "state": f"{{0}} IN ({_STATES})",
        "sent_at": f"{{0}} IS NULL OR {_TEXT}",
        "cap_s": f"{{0}} IS NULL OR {_NUMBER}",
        "job_id": f"{{0}} IS NULL OR {_TEXT}",
        "ones": f"{{0}} IS NULL OR {_BLOB}",
        "words": f"{{0}} IS NULL OR {_TEXT}",
    },
    "measured": {
        "number": _COUNT,
        "pub": _COUNT,
        "name": _TEXT,
        "shape": _TEXT,
        "width": _COUNT,
        "packed": f"{{0}} IS NULL OR {_BLOB}",
    },
    "charge": {
        "number": f"{{0}} IS NULL OR {_COUNT}",
        "executions": _COUNT,
        "cap_s": f"{_NUMBER} AND {{0}} >= 0",
        "sent_at": f"{_TEXT} AND julianday({{0}}) IS NOT NULL",
        "refused": "{0} IN (0, 1)",
        "job_id": f"{{0}} IS NULL OR {_TEXT}",
        "charged_s": f"{{0}} IS NULL OR ({_NUMBER} AND {{0}} >= 0)",
    },
    "step": {
        "number": _COUNT,
        "observations": _BLOB,
        "actions": _BLOB,
        "rewards": f"{{0}} IS NULL OR {_BLOB}",
    },
}
_RIGHT_AT_FIRST = {name: _RIGHT[name] for name in ("run", "step")} | {
    "submission": {**_RIGHT["submission"], "charged_s": f"{{0}} IS NULL OR {_NUMBER}"},
    "extra": {
        "job_id": _TEXT,
        "executions": _COUNT,
        "cap_s": f"{{0}} IS NULL OR {_NUMBER}",
        "charged_s": f"{{0}} IS NULL OR {_NUMBER}",
    },
}
_RIGHT_IN = {
    schema.FORMAT: _RIGHT,
    schema.SECOND_FORMAT: {name: rules for name, rules in _RIGHT.items() if name != "measured"},
    schema.FIRST_FORMAT: _RIGHT_AT_FIRST,
}
"""The valid values of each table. SQLite answers `typeof` without reading a blob."""
_EXECUTED = """
SELECT name FROM sqlite_master
WHERE type NOT IN ('table', 'index') OR sql LIKE 'CREATE VIRTUAL%'
UNION SELECT m.name FROM sqlite_master AS m, pragma_table_xinfo(m.name) AS c WHERE c.hidden != 0
"""
"""Finds views, triggers, virtual tables and computed columns: a journal has none."""


class NeverBegunError(LiveError):
    """The run was stopped while its journal was being created: nothing was ever sent."""


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """A block whose read errors become explained errors that name the file.

    Raises:
        LiveError: the file is damaged, or cannot be read or written.
    """
    try:
        yield
    except LiveError as error:
        if str(path) in str(error):
            raise
        raise LiveError(f"{path}: {error}") from error
    except (sqlite3.Error, ValueError, TypeError, RecursionError, OverflowError) as error:
        words = one_line(str(error), 200).rstrip(".")
        why = words if isinstance(error, sqlite3.Error) else "it is damaged"
        raise LiveError(f"{path} cannot be read: {why}.", _RESTORE) from error


def connect(path: Path) -> sqlite3.Connection:
    """A connection that flushes every write to the disk and tolerates broken text.

    Raises:
        LiveError: the file is not a database.
        NeverBegunError: the file is empty.
    """
    with reading(path):
        db = sqlite3.connect(path, isolation_level=None)
    try:
        with reading(path):
            db.text_factory = _text
            db.execute("PRAGMA synchronous = FULL")
            db.execute("PRAGMA trusted_schema = OFF")
            if db.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchone() is None:
                raise NeverBegunError(
                    f"{path} is empty: the run was stopped before it began.", "Delete its folder."
                )
    except BaseException:
        db.close()
        raise
    return db


def check_values(db: sqlite3.Connection, path: Path, format_: str) -> None:
    """Check that all rows hold valid values for this journal format; blobs are not read.

    Raises:
        LiveError: a value is not valid, and the message names its table and column; or the file
            contains something that SQLite would execute.
    """
    with reading(path):
        if db.execute(_EXECUTED).fetchone() is not None:
            raise LiveError(f"{path} is not a journal of qcompile.", _RESTORE)
        for table, rules in _RIGHT_IN[format_].items():
            tests = " ".join(
                f"WHEN NOT ifnull({rule.format(column)}, 0) THEN '{column}'"
                for column, rule in rules.items()
            )
            wrong = db.execute(
                f"SELECT wrong FROM (SELECT CASE {tests} END AS wrong FROM {table}) "
                "WHERE wrong IS NOT NULL LIMIT 1"
            ).fetchone()
            if wrong is not None:
                raise LiveError(f"{path} is damaged: {table}.{wrong[0]} is not valid.", _RESTORE)


def check_pages(db: sqlite3.Connection, path: Path) -> None:
    """Check with SQLite that no row was lost to damage.

    Raises:
        LiveError: SQLite finds damage.
    """
    with reading(path):
        words = str(db.execute("PRAGMA integrity_check(1)").fetchone()[0])
        if words != "ok":
            raise LiveError(f"{path} is damaged: {one_line(words, 200)}.", _RESTORE)


def json_object(text: str | None) -> dict[str, Any]:
    """The JSON object in a column.

    Raises:
        ValueError: it holds something else.
    """
    value = load_json(text) if isinstance(text, str) else None
    if not isinstance(value, dict):
        raise ValueError("not a JSON object")
    return value


def write_journal(folder: Path, fill: Callable[[sqlite3.Connection], None]) -> None:
    """Create `folder` with a journal that `fill` fills; it appears whole or not at all.

    The folder, and its parent if that is created too, are readable by this user only.

    Raises:
        LiveError: it cannot be written.
    """
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
        try:
            with closing(sqlite3.connect(temporary / FILE, isolation_level=None)) as db:
                db.execute("PRAGMA journal_mode = WAL")
                db.execute("BEGIN")
                fill(db)
                db.execute("COMMIT")
            temporary.rename(folder)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        sync(folder.parent)
    except (OSError, sqlite3.Error) as error:
        raise LiveError(
            f"Cannot write the run's journal to {folder}: {error}.",
            "Nothing was sent. Choose another folder with --runs.",
        ) from error


def _text(contents: bytes) -> str:
    return contents.decode(errors="replace")
