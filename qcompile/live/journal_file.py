"""The file of a journal: made whole or not at all, and looked over before anything of it is used.

It may be damaged, and it may come from somebody else. What passes here has the tables, columns and
types that a journal has, and nothing in it that SQLite would execute.
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
_RESTORE = "Copy the run to a folder that can be written; if it is damaged, restore it."

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
"""What must hold of the values of a table. SQLite answers `typeof` without reading a blob."""
_EXECUTED = """
SELECT name FROM sqlite_master
WHERE type NOT IN ('table', 'index') OR sql LIKE 'CREATE VIRTUAL%'
UNION SELECT m.name FROM sqlite_master AS m, pragma_table_xinfo(m.name) AS c WHERE c.hidden != 0
"""
"""Views, triggers, virtual tables and computed columns: a journal has none."""


class NeverBegunError(LiveError):
    """A run was stopped while its journal was being made: nothing of it was ever sent."""


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Whatever cannot be read within the block is with_advice, with the name of the file.

    Raises:
        LiveError: it is damaged, or cannot be read or written.
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
    """A connection that has every write on the disk before it goes on, and reads broken text.

    Raises:
        LiveError: the file is no database.
        NeverBegunError: it is empty.
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
                    f"{path} is empty: the run was stopped before it began.", "Remove its folder."
                )
    except BaseException:
        db.close()
        raise
    return db


def check_values(db: sqlite3.Connection, path: Path, format_: str) -> None:
    """Nothing, if all rows hold what they may hold in a journal of this format; blobs are not read.

    Raises:
        LiveError: one does not; the message names its table and column. Or SQLite would execute
            something that is in the file.
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
                raise LiveError(f"{path} is damaged: {wrong[0]} of a {table} is wrong.", _RESTORE)


def check_pages(db: sqlite3.Connection, path: Path) -> None:
    """Nothing, if SQLite finds every row that its indexes know: none was lost to damage.

    Raises:
        LiveError: what SQLite finds.
    """
    with reading(path):
        words = str(db.execute("PRAGMA integrity_check(1)").fetchone()[0])
        if words != "ok":
            raise LiveError(f"{path} is damaged: {one_line(words, 200)}.", _RESTORE)


def json_object(text: str | None) -> dict[str, Any]:
    """The object that a column holds as JSON.

    Raises:
        ValueError: it holds none.
    """
    value = load_json(text) if isinstance(text, str) else None
    if not isinstance(value, dict):
        raise ValueError("no object")
    return value


def write_journal(folder: Path, fill: Callable[[sqlite3.Connection], None]) -> None:
    """Make `folder` with a journal that `fill` fills; it appears whole, or not at all.

    The folder, and its parent where that is made too, can be read by this user alone.

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
            f"The run's journal cannot be written to {folder}: {error}.",
            "Nothing was sent. Choose another folder with --runs.",
        ) from error


def _text(contents: bytes) -> str:
    return contents.decode(errors="replace")
