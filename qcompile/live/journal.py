"""The journal of a live run: an SQLite file in the run's folder, written before anything is sent.

A submission is written down first, with a tag that finds its job again; then that it is being sent;
then its job's id; then its counts and charge. Every write is on the disk before the next thing
happens.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, Self, get_args

import numpy as np
from filelock import FileLock, Timeout

from qcompile.errors import LiveError
from qcompile.execution.executor import CountArray, FloatArray
from qcompile.limits import MAX_QPU_SECONDS
from qcompile.live import home
from qcompile.live.opening import (
    FILE,
    check_pages,
    check_values,
    connect,
    json_object,
    reading,
    write_journal,
)
from qcompile.live.records import Charge, State, Step, Submission, to_bytes
from qcompile.live.words import said

TaskKind = Literal["run", "calibrate", "validate"]

FORMAT = "qcompile-journal-1"
_ID = re.compile(r"[\w.-]{1,100}", re.ASCII)
_SCHEMA = """
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


class Journal:
    """The record of one run in `folder`; `create` starts one. A `with` block closes it.

    It is held by one process at a time: `held` is the block in which it may be written. One that is
    not `checked` serves to read its attributes alone.

    Raises:
        LiveError: the folder holds no journal that can be read, here and wherever it is read or
            written.
    """

    def __init__(self, folder: Path, *, checked: bool = True):
        self.folder, self.path = folder, folder / FILE
        if not self.path.is_file():
            raise LiveError(f"{folder} holds no run.", "`qcompile runs` lists the runs.")
        self._db = connect(self.path)
        try:
            with reading(self.path):
                self._read()
            if checked:
                check_values(self._db, self.path)
        except BaseException:
            self._db.close()
            raise

    def _read(self) -> None:
        """Read what does not change of the run."""
        row = self._db.execute(
            "SELECT format, id, kind, created, settings, versions FROM run"
        ).fetchone()
        if row is None or row[0] != FORMAT:
            raise LiveError(f"{self.path} is no journal that this version of qcompile can read.")
        self.id: str = row[1]
        self.kind: TaskKind = row[2]
        self.created = datetime.fromisoformat(row[3])
        self.settings: dict[str, Any] = json_object(row[4])
        self.versions: dict[str, str] = json_object(row[5])
        is_known = _ID.fullmatch(self.id) and self.kind in get_args(TaskKind)
        is_text = all(isinstance(version, str) for version in self.versions.values())
        if not is_known or not is_text or self.created.tzinfo is None:
            raise ValueError("an ID, a kind, a time or a version that no run has")

    @classmethod
    def create(
        cls,
        runs: Path,
        kind: TaskKind,
        name: str,
        settings: dict[str, Any],
        versions: dict[str, str],
        max_qpu_seconds: float,
    ) -> Journal:
        """A new run in a folder of its own below `runs`, named by time and `name`."""
        now = datetime.now(UTC)
        words = "".join(c if c.isascii() and c.isalnum() else "-" for c in name)[:12]
        run_id = f"{now:%y%m%d-%H%M%S}-{words}-{secrets.token_hex(2)}"
        folder = runs / run_id
        values = (FORMAT, run_id, kind, now.isoformat(), json.dumps(settings), json.dumps(versions))

        def fill(db: sqlite3.Connection) -> None:
            for statement in _SCHEMA.split(";"):
                db.execute(statement)
            for moment in get_args(home.Moment):
                home.note(db, moment, home.here(run_id, folder))
            db.execute("INSERT INTO run VALUES (?,?,?,?,?,?,?,NULL)", (*values, max_qpu_seconds))

        write_journal(folder, fill)
        return cls(folder)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self._db.close()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the run: no other process may go on with it meanwhile.

        Raises:
            LiveError: another process holds it, or it is damaged.
        """
        lock = FileLock(self.folder / "lock", timeout=0)
        try:
            lock.acquire()
        except Timeout as error:
            raise LiveError(
                f"Run {self.id} is going on in another process.", "Wait for it, or stop it."
            ) from error
        except OSError as error:
            raise LiveError(f"{self.folder} cannot be written: {error}.") from error
        try:
            check_pages(self._db, self.path)
            self.move_here(os.getpid())
            try:
                yield
            finally:
                with suppress(LiveError):
                    self.move_here()
        finally:
            lock.release()

    # Where it is at home

    def home(self, moment: home.Moment) -> home.Home | None:
        """Where it began, or was resumed last; None where the journal does not say."""
        with reading(self.path):
            return home.read(self._db, moment)

    def move_here(self, process: int | None = None) -> None:
        """From now on the run is at home in this folder of this machine."""
        with reading(self.path):
            home.note(self._db, "last", replace(home.here(self.id, self.folder), process=process))

    # The run

    @property
    def max_qpu_seconds(self) -> float:
        """Its limit; the largest there is where the first version let it be infinite."""
        return min(float(self._rows("SELECT max_qpu_seconds FROM run")[0][0]), MAX_QPU_SECONDS)

    def allow(self, max_qpu_seconds: float) -> None:
        """Set another limit."""
        self._do("UPDATE run SET max_qpu_seconds = ?", max_qpu_seconds)

    @property
    def result(self) -> dict[str, Any] | None:
        """What the run found, once it is finished."""
        text = self._rows("SELECT result FROM run")[0][0]
        with reading(self.path):
            return None if text is None else json_object(text)

    def finish(self, result: dict[str, Any]) -> None:
        self._do("UPDATE run SET result = ?", json.dumps(result))

    # Its submissions

    def submissions(self, where: str = "TRUE") -> list[Submission]:
        """Every attempt, in order."""
        rows = self._rows(
            f"SELECT {Submission.COLUMNS} FROM submission WHERE {where} ORDER BY number, attempt"
        )
        with reading(self.path):
            return [Submission.of_row(row) for row in rows]

    def latest(self, number: int) -> Submission | None:
        """The last attempt at job `number` of the run."""
        found = self.submissions(f"number = {number:d}")
        return found[-1] if found else None

    def charges(self, but: Submission | None = None) -> list[Charge]:
        """What was sent costs, `but` one submission."""
        tag = "" if but is None else but.tag
        rows = self._rows(
            "SELECT executions, cap_s, charged_s FROM submission WHERE state != 'intended' "
            "AND tag != ? UNION ALL SELECT executions, cap_s, charged_s FROM extra",
            tag,
        )
        return [Charge(*row) for row in rows]

    def jobs_done(self) -> int:
        return self.states().get("done", 0)

    def states(self) -> dict[State, int]:
        """How many submissions are in each state; their counts are not read."""
        return dict(self._rows("SELECT state, COUNT(*) FROM submission GROUP BY state"))

    def uncharged(self) -> list[str]:
        """The ids of ended jobs whose charge is not known."""
        rows = self._rows(
            "SELECT job_id FROM submission WHERE charged_s IS NULL AND state IN ('done', 'failed') "
            "AND job_id IS NOT NULL UNION SELECT job_id FROM extra WHERE charged_s IS NULL "
            "AND job_id NOT LIKE 'doubt %'"
        )
        return [row[0] for row in rows]

    def intend(self, number: int, digest: str, executions: int) -> Submission:
        """Write down that job `number` is about to be sent, once more where it failed before."""
        last = self.latest(number)
        attempt = 0 if last is None else last.attempt + 1
        tag = f"qcompile-{self.id}-{number}-{attempt}"
        self._do(
            f"INSERT INTO submission ({Submission.COLUMNS}) "
            "VALUES (?,?,?,?,?,'intended',NULL,NULL,NULL,NULL,NULL,NULL)",
            *(number, attempt, tag, digest, executions),
        )
        return self.submissions(f"number = {number:d}")[-1]

    def note_sending(self, submission: Submission, cap_s: int) -> Submission:
        """It is being sent now, and IBM is to cut it off after `cap_s`."""
        now = datetime.now(UTC)
        self._note(submission, "state = 'sending', sent_at = ?, cap_s = ?", now.isoformat(), cap_s)
        return replace(submission, state="sending", sent_at=now, cap_s=cap_s)

    def note_sent(self, submission: Submission, job_id: str) -> None:
        """Its job is known by `job_id`."""
        self._note(submission, "state = 'sent', job_id = ?", job_id)

    def note_done(self, submission: Submission, ones: CountArray, charged_s: float | None) -> None:
        """Its counts are here."""
        self._note(submission, "state = 'done', ones = ?, charged_s = ?", to_bytes(ones), charged_s)

    def note_failed(self, submission: Submission, words: str, charged_s: float | None) -> None:
        """It ended without counts; `words` of the service are kept without what is secret."""
        words = said(words)
        self._note(submission, "state = 'failed', words = ?, charged_s = ?", words, charged_s)

    def note_extra(self, submission: Submission, job_id: str) -> None:
        """IBM has a second job of a submission, which may be charged as well."""
        values = (job_id, submission.executions, submission.cap_s)
        self._do("INSERT OR IGNORE INTO extra VALUES (?,?,?,NULL)", *values)

    def note_doubt(self, submission: Submission) -> None:
        """IBM may have accepted a job of the submission, and be slow to list it: its cap counts."""
        self.note_extra(submission, f"doubt {submission.tag}")

    def in_doubt(self, submission: Submission) -> bool:
        """Whether `note_doubt` was said of it, and not taken back."""
        tag = f"doubt {submission.tag}"
        return bool(self._rows("SELECT 1 FROM extra WHERE job_id = ?", tag))

    def clear_doubt(self, submission: Submission) -> None:
        """What `note_doubt` said has turned out one way or the other."""
        self._do("DELETE FROM extra WHERE job_id = ?", f"doubt {submission.tag}")

    def note_charge(self, job_id: str, charged_s: float) -> None:
        """What IBM charged for a job is known now."""
        for table in ("submission", "extra"):
            self._do(f"UPDATE {table} SET charged_s = ? WHERE job_id = ?", charged_s, job_id)

    def _note(self, submission: Submission, what: str, *values: object) -> None:
        self._do(f"UPDATE submission SET {what} WHERE tag = ?", *values, submission.tag)

    # Its steps

    def step(self, number: int) -> Step | None:
        """Step `number` of the lockstep, if it was taken."""
        rows = self._rows(
            "SELECT observations, actions, rewards FROM step WHERE number = ?", number
        )
        with reading(self.path):
            return Step.of_row(rows[0]) if rows else None

    def note_actions(self, number: int, observations: FloatArray, actions: CountArray) -> None:
        """The actions (B,) of a step for its observations (B, features)."""
        values = (number, to_bytes(observations), to_bytes(actions.astype(np.int64)))
        self._do("INSERT INTO step VALUES (?,?,?,NULL)", *values)

    def note_rewards(self, number: int, rewards: list[float]) -> None:
        """What the actions of a step earned."""
        self._do(
            "UPDATE step SET rewards = ? WHERE number = ?", to_bytes(np.array(rewards)), number
        )

    def step_count(self) -> int:
        return int(self._rows("SELECT COUNT(*) FROM step")[0][0])

    def _rows(self, statement: str, *values: object) -> list[tuple[Any, ...]]:
        """What the journal holds."""
        with reading(self.path):
            return self._db.execute(statement, values).fetchall()

    def _do(self, statement: str, *values: object) -> sqlite3.Cursor:
        """Have it on the disk, or read from it, before anything else happens."""
        try:
            return self._db.execute(statement, values)
        except sqlite3.Error as error:
            raise LiveError(
                f"The run's journal in {self.folder} cannot be read or written: {error}.",
                "What was sent has its tag in it and is found again, once this is mended.",
            ) from error
