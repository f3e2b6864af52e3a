"""The journal of a live run: an SQLite file in the run's folder, written before anything is sent.

A submission is written down first, with what it measures and a tag that finds its job again; then
that it is being sent, as a charge in doubt; then its job's id; then its bits; then what it was
charged. Every write is on the disk before the next thing happens.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, Self, get_args

from qcompile.errors import LiveError
from qcompile.limits import MAX_QPU_SECONDS
from qcompile.live import home, schema
from qcompile.live.charges import Charges, check_limit
from qcompile.live.client_errors import quoted
from qcompile.live.database import Database
from qcompile.live.journal_file import (
    FILE,
    check_pages,
    check_values,
    json_object,
    reading,
    write_journal,
)
from qcompile.live.measured import Measured
from qcompile.live.records import Register, State, Submission
from qcompile.live.steps import Steps

TaskKind = Literal["run", "calibrate", "validate", "sampler"]

_ID = re.compile(r"[\w.-]{1,100}", re.ASCII)


class Journal:
    """The record of one run in `folder`; `create` starts one. A `with` block closes it.

    It is held by one process at a time: `held` is the block in which it may be written. `charges`
    are what its jobs cost, `measured` what they gave, `steps` what it has played. One that is not
    `checked` serves to read its attributes alone.

    Raises:
        LiveError: the folder holds no journal that can be read, here and wherever it is read or
            written.
    """

    def __init__(self, folder: Path, *, checked: bool = True):
        self.folder, self.path = folder, folder / FILE
        if not self.path.is_file():
            raise LiveError(f"{folder} holds no run.", "`qcompile runs` lists the runs.")
        self._db = Database(self.path)
        try:
            with reading(self.path):
                format_ = self._read()
            if checked:
                check_values(self._db.connection, self.path, format_)
                with reading(self.path):
                    schema.read_as_now(self._db.connection, format_)
        except BaseException:
            self._db.close()
            raise
        self.charges = Charges(self._db)
        self.steps = Steps(self._db)
        self.measured = Measured(self._db)
        self._jobs_done: int | None = None

    def _read(self) -> str:
        """Read what does not change of the run; its format."""
        row = self._db.connection.execute(
            "SELECT format, id, kind, created, settings, versions FROM run"
        ).fetchone()
        if row is None or row[0] not in schema.FORMATS:
            raise LiveError(f"{self.path} is not a journal that this version of qcompile can read.")
        self.id: str = row[1]
        self.kind: TaskKind = row[2]
        self.created = datetime.fromisoformat(row[3])
        self.settings: dict[str, Any] = json_object(row[4])
        self.versions: dict[str, str] = json_object(row[5])
        is_known = _ID.fullmatch(self.id) and self.kind in get_args(TaskKind)
        is_text = all(isinstance(version, str) for version in self.versions.values())
        if not is_known or not is_text or self.created.tzinfo is None:
            raise ValueError("an ID, a kind, a time or a version that no run has")
        return str(row[0])

    @classmethod
    def create(
        cls,
        runs: Path,
        kind: TaskKind,
        name: str,
        settings: dict[str, Any],
        versions: dict[str, str],
        max_qpu_seconds: float,
        *,
        folder: Path | None = None,
    ) -> Journal:
        """A new run in a folder of its own below `runs`, named by time and `name`; or in `folder`.

        Raises:
            BudgetError: the limit is no number of seconds that may be spent.
        """
        check_limit(max_qpu_seconds)
        now = datetime.now(UTC)
        words = "".join(c if c.isascii() and c.isalnum() else "-" for c in name)[:12]
        run_id = f"{now:%y%m%d-%H%M%S}-{words}-{secrets.token_hex(2)}"
        folder = folder or runs / run_id
        values = (
            *(schema.FORMAT, run_id, kind, now.isoformat()),
            *(json.dumps(settings), json.dumps(versions)),
        )

        def fill(db: sqlite3.Connection) -> None:
            schema.create(db)
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
    def locked(self) -> Iterator[None]:
        """Hold the run: no other process may resume it meanwhile.

        Raises:
            LiveError: another process holds it, or it is damaged.
        """
        with home.one_process(self.id, self.folder):
            check_pages(self._db.connection, self.path)
            self._renew()
            holder = os.getpid()
            self.move_here(holder)
            try:
                yield
            finally:
                if os.getpid() == holder:  # and not a fork of it
                    with suppress(LiveError):
                        self.move_here()

    def _renew(self) -> None:
        """Have it in the format of today, and nothing remembered that another process changed."""
        with reading(self.path):
            schema.migrate(self._db.connection)
        self.charges.forget_sums()
        self._jobs_done = None

    # Where it is at home

    def home(self, moment: home.Moment) -> home.Home | None:
        """Where it began, or was resumed last; None where the journal does not say."""
        with reading(self.path):
            return home.read(self._db.connection, moment)

    def move_here(self, process: int | None = None) -> None:
        """From now on the run is at home in this folder of this machine."""
        with reading(self.path):
            home.note(
                self._db.connection,
                "last",
                replace(home.here(self.id, self.folder), process=process),
            )

    # The run

    @property
    def max_qpu_seconds(self) -> float:
        """Its limit; the largest there is where the first version let it be infinite."""
        return min(float(self._db.rows("SELECT max_qpu_seconds FROM run")[0][0]), MAX_QPU_SECONDS)

    def allow(self, max_qpu_seconds: float) -> None:
        """Set another limit.

        Raises:
            BudgetError: it is no number of seconds that may be spent.
        """
        check_limit(max_qpu_seconds)
        self._db.do("UPDATE run SET max_qpu_seconds = ?", max_qpu_seconds)

    @property
    def result(self) -> dict[str, Any] | None:
        """What the run found, once it is finished."""
        text = self._db.rows("SELECT result FROM run")[0][0]
        with reading(self.path):
            return None if text is None else json_object(text)

    def finish(self, result: dict[str, Any]) -> None:
        self._db.do("UPDATE run SET result = ?", json.dumps(result))

    # Its submissions

    def submissions(self, where: str = "TRUE", *values: object) -> list[Submission]:
        """Every attempt for which `where` holds, in order."""
        columns = ", ".join(f"submission.{column}" for column in Submission.COLUMNS.split(", "))
        rows = self._db.rows(
            f"SELECT {columns}, charge.charged_s FROM submission "
            "LEFT JOIN charge ON charge.job_id = submission.job_id "
            f"WHERE {where} ORDER BY submission.number, attempt",
            *values,
        )
        with reading(self.path):
            return [Submission.of_row(row) for row in rows]

    def attempts(self, number: int) -> list[Submission]:
        """Every attempt at job `number` of the run."""
        return self.submissions("submission.number = ?", number)

    def latest(self, number: int) -> Submission | None:
        """The last attempt at job `number` of the run."""
        attempts = self.attempts(number)
        return attempts[-1] if attempts else None

    def jobs_done(self) -> int:
        if self._jobs_done is None:
            self._jobs_done = self.states().get("done", 0)
        return self._jobs_done

    def states(self) -> dict[State, int]:
        """How many submissions are in each state; their counts are not read."""
        return dict(self._db.rows("SELECT state, COUNT(*) FROM submission GROUP BY state"))

    def intend(
        self, number: int, digest: str, executions: int, registers: Sequence[Register] = ()
    ) -> Submission:
        """Write down that job `number` is about to be sent, once more where it failed before.

        `registers` are what it measures.
        """
        last = self.latest(number)
        attempt = 0 if last is None else last.attempt + 1
        tag = f"{self.tag_prefix}{number}-{attempt}"
        with self._db.at_once():
            self.measured.note(number, registers)
            self._db.do(
                f"INSERT INTO submission ({Submission.COLUMNS}) "
                "VALUES (?,?,?,?,?,'intended',NULL,NULL,NULL,NULL,NULL)",
                *(number, attempt, tag, digest, executions),
            )
        return self.attempts(number)[-1]

    @property
    def tag_prefix(self) -> str:
        """What the tag of each of its jobs begins with, before number and attempt."""
        return f"qcompile-{self.id}-"

    def note_sending(self, submission: Submission, cap_s: int) -> Submission:
        """It is being sent now, and IBM is to cut it off after `cap_s`."""
        now = datetime.now(UTC)
        with self._db.at_once():
            self.charges.note_doubt(submission.number, submission.executions, cap_s, now)
            self._note(
                submission, "state = 'sending', sent_at = ?, cap_s = ?", now.isoformat(), cap_s
            )
        return replace(submission, state="sending", sent_at=now, cap_s=cap_s)

    def note_sent(self, submission: Submission, job_id: str) -> None:
        """IBM answered what was sent last with its job's id."""
        doubt = self.charges.doubts(submission.number)[-1]
        with self._db.at_once():
            self.charges.note_job(doubt, job_id, doubt.cap_s)
            self.note_adopted(submission, job_id)

    def note_adopted(self, submission: Submission, job_id: str) -> None:
        """A job that is known is that of the submission: its counts are waited for."""
        self._note(submission, "state = 'sent', job_id = ?", job_id)

    def note_done(self, submission: Submission, registers: Sequence[Register]) -> None:
        """Its bits are here."""
        with self._db.at_once():
            self.measured.note(submission.number, registers)
            self._note(submission, "state = 'done'")
        if self._jobs_done is not None:
            self._jobs_done += 1

    def note_failed(self, submission: Submission, words: str) -> None:
        """It ended without counts; `words` of the service are kept without what is secret."""
        self._note(submission, "state = 'failed', words = ?", quoted(words))

    def _note(self, submission: Submission, what: str, *values: object) -> None:
        self._db.do(f"UPDATE submission SET {what} WHERE tag = ?", *values, submission.tag)
