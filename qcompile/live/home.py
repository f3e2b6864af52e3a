"""Where a run is at home: the machine and the folder that last resumed it.

Two copies of a run that are resumed at once would pay most jobs twice, and a journal may come from
somebody else. So a run is resumed unasked only where it is at home. The journal keeps digests, with
the run's ID as salt, not the names: who gets a copy learns neither machine nor folder from it.
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
"""Where a run began, and where it was resumed last."""

_MACHINE_ID = Path("/etc/machine-id")
_TABLE = """
CREATE TABLE IF NOT EXISTS home (
  moment TEXT PRIMARY KEY, machine TEXT, folder TEXT, process INTEGER
)
"""


@dataclass(frozen=True)
class Home:
    """Digests of a machine and of the run's folder on it.

    `process` holds the run, or was killed while it did; None where it ended in order.
    """

    machine: str
    folder: str
    process: int | None = None


def is_same_place(one: Home | None, other: Home) -> bool:
    """Whether both are the same folder of the same machine."""
    return one is not None and (one.machine, one.folder) == (other.machine, other.folder)


def here(run_id: str, folder: Path) -> Home:
    """This machine and `folder`, for the run `run_id`."""

    def digest(name: object) -> str:
        return hashlib.sha256(f"{run_id}\n{_machine()}\n{name}".encode()).hexdigest()

    return Home(digest(""), digest(folder.resolve()))


def read(db: sqlite3.Connection, moment: Moment) -> Home | None:
    """What a journal says; None where it does not, as those of the first version."""
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
    """Write it down in a journal."""
    db.execute(_TABLE)
    values = (home.machine, home.folder, home.process)
    db.execute("INSERT OR REPLACE INTO home VALUES (?,?,?,?)", (moment, *values))


@contextmanager
def one_process(run_id: str, folder: Path) -> Iterator[None]:
    """Hold the lock of a run's folder: no other process of this machine holds it meanwhile.

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
        raise LiveError(f"{folder} cannot be written: {error}.") from error
    try:
        yield
    finally:
        lock.release()


def _machine() -> str:
    """What this machine is known by: its name, and its own ID, where it has one."""
    machine_id = ""
    with suppress(OSError, ValueError):
        machine_id = decode(read_file(_MACHINE_ID)).strip()
    return f"{platform.node()}\n{machine_id}"
