"""The home of a run: the machine and the folder that last resumed it.

Two copies of a run that are resumed at the same time would pay for most jobs twice, and a journal
may come from somebody else. So a run is resumed without asking only at its home. The journal stores
digests salted with the run's ID, not names: a copy reveals neither machine nor folder.
"""

from __future__ import annotations

import hashlib
import platform
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from filelock import FileLock, Timeout

from qcompile.errors import LiveError
from qcompile.reading import decode, read_file

Moment = Literal["began", "last"]
"""Where a run began and where it was last resumed."""

_MACHINE_ID = Path("/etc/machine-id")
_TABLE = """
CREATE TABLE IF NOT EXISTS home (
  moment TEXT PRIMARY KEY, machine TEXT, folder TEXT, process INTEGER
)
"""


@dataclass(frozen=True)
class Home:
    """Digests of a machine and of the run's folder on it.

    `process` holds the run, or was killed while it did; None if it ended normally.
    """

    machine: str
    folder: str
    process: int | None = None


def is_same_place(one: Home | None, other: Home) -> bool:
    """Whether both are the same folder of the same machine."""
    return one is not None and (one.machine, one.folder) == (other.machine, other.folder)


def here(run_id: str, folder: Path) -> Home:
    """The home for the run `run_id` in `folder` on this machine."""

    def digest(name: object) -> str:
        return hashlib.sha256(f"{run_id}\n{_machine()}\n{name}".encode()).hexdigest()

    return Home(digest(""), digest(folder.resolve()))


def read(db: sqlite3.Connection, moment: Moment) -> Home | None:
    """The home recorded in a journal; None in journals of the first version, which have none."""
    if not db.execute("SELECT 1 FROM sqlite_master WHERE name = 'home'").fetchall():
        return None
    row = db.execute(
        "SELECT machine, folder, process FROM home WHERE moment = ?", (moment,)
    ).fetchone()
    if row is None:
        return None
    machine, folder, process = row
    return Home(machine, folder, process if isinstance(process, int) else None)


def note(db: sqlite3.Connection, moment: Moment, home: Home) -> None:
    """Record a home in a journal."""
    db.execute(_TABLE)
    values = (home.machine, home.folder, home.process)
    db.execute("INSERT OR REPLACE INTO home VALUES (?,?,?,?)", (moment, *values))


@contextmanager
def one_process(run_id: str, folder: Path) -> Iterator[None]:
    """Lock a run's folder against other processes of this machine.

    Raises:
        LiveError: another process holds it, or the folder cannot be written.
    """
    lock = FileLock(folder / "lock", timeout=0)
    try:
        lock.acquire()
    except Timeout as error:
        raise LiveError(
            f"Run {run_id} is running in another process.", "Wait for it, or stop it."
        ) from error
    except OSError as error:
        raise LiveError(f"Cannot write to {folder}: {error}.") from error
    try:
        yield
    finally:
        lock.release()


def _machine() -> str:
    """This machine's name and, if it has one, its machine ID."""
    machine_id = ""
    with suppress(OSError, ValueError):
        machine_id = decode(read_file(_MACHINE_ID)).strip()
    return f"{platform.node()}\n{machine_id}"
