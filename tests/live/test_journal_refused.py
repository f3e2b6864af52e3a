"""Unusable journals: locked by another process, damaged, foreign, or read-only."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from qcompile.errors import LiveError
from qcompile.live.journal import Journal
from qcompile.live.journal_file import FILE

HOLD = """
import sys
from pathlib import Path
from qcompile.live.journal import Journal
with Journal(Path(sys.argv[1])).locked():
    print("held", flush=True)
    sys.stdin.read()
"""


def new() -> Journal:
    return Journal.create(Path("runs"), "run", "cart", {}, {}, 10.0)


def test_one_process_at_a_time_goes_on_with_a_run() -> None:
    journal = new()
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(journal.folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    with pytest.raises(LiveError) as caught, journal.locked():
        pass
    assert str(caught.value) == (
        f"Run {journal.id} is running in another process.\n  Wait for it, or stop it."
    )
    assert Journal(journal.folder).submissions() == []  # it can be looked at meanwhile
    holder.kill()  # and a process that dies holds nothing
    holder.communicate()
    with journal.locked():
        pass


def test_a_folder_without_a_journal() -> None:
    Path("empty").mkdir()
    with pytest.raises(
        LiveError, match=r"^There is no run in empty\.\n  `qcompile runs` lists the runs"
    ):
        Journal(Path("empty"))


def test_a_damaged_journal_is_explained() -> None:
    with new() as journal:
        pass
    journal.path.write_bytes(b"not a database, but long enough to be one" * 100)
    with pytest.raises(
        LiveError,
        match=r"cannot be read: .*\n  Copy the run to a writable folder",
    ):
        Journal(journal.folder)


def test_a_journal_cut_in_half_is_explained() -> None:
    """It is noticed on opening, or when a missing page is needed."""
    with new() as journal:
        for number in range(50):
            journal.intend(number, "d" * 500, 1)
    path = journal.folder / FILE
    path.write_bytes(path.read_bytes()[:20_000])
    with pytest.raises(LiveError, match=r"cannot be read") as caught:
        Journal(journal.folder).submissions()
    assert str(journal.folder) in str(caught.value)
    assert "malformed" in str(caught.value)


def test_a_file_that_cannot_be_written_is_explained() -> None:
    """No write is taken for committed."""
    journal = new()
    made = journal.intend(0, "d", 1)
    with sqlite3.connect(journal.folder / FILE) as other:
        other.execute("BEGIN IMMEDIATE")
        journal._db.connection.execute("PRAGMA busy_timeout = 1")
        for write in (
            lambda: journal.note_sending(made, 5),
            lambda: journal.intend(1, "d", 1),
            lambda: journal.finish({}),
        ):
            with pytest.raises(LiveError) as caught:
                write()
            assert str(caught.value) == (
                f"The run's journal in {journal.folder} cannot be read or written: database is "
                "locked.\n"
                "  Jobs that were sent are recorded in it and are found again once this is fixed."
            )
    assert journal.submissions() == [made]
    assert journal.result is None


def test_a_folder_that_cannot_be_locked_is_explained() -> None:
    journal = new()
    (journal.folder / "lock").mkdir()
    with pytest.raises(LiveError, match=r"^Cannot write to .*: "), journal.locked():
        pass


@pytest.mark.parametrize(
    "change", ["UPDATE run SET format = 'qcompile-journal-9'", "DELETE FROM run"]
)
def test_a_foreign_format_is_refused(change: str) -> None:
    journal = new()
    with sqlite3.connect(journal.folder / FILE) as db:
        db.execute(change)
    with pytest.raises(LiveError, match="is not a journal that this version of qcompile can read"):
        Journal(journal.folder)


def test_a_folder_that_cannot_be_made_is_explained_before_anything_is_sent() -> None:
    Path("runs").write_text("a file stands where the folder should be")
    with pytest.raises(LiveError) as caught:
        new()
    assert "Cannot write the run's journal to runs/" in str(caught.value)
    assert "\n  Nothing was sent. Choose another folder with --runs." in str(caught.value)


def test_a_tag_cannot_be_written_twice() -> None:
    """The database itself keeps tags and attempts unique."""
    journal = new()
    made = journal.intend(0, "d", 1)
    with sqlite3.connect(journal.folder / FILE) as db:
        for number in (0, 7):
            with pytest.raises(sqlite3.IntegrityError, match="UNIQUE"):
                db.execute(
                    "INSERT INTO submission (number, attempt, tag) VALUES (?, 0, ?)",
                    (number, made.tag if number else "another"),
                )
