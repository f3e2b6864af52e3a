"""The journal of a live run: an SQLite file in the run's folder, written before any job is sent.

A submission is recorded first, with its registers and a tag by which its job can be found again;
then that it is being sent, as a charge in doubt; then its job's id; then its bits; then its charge.
Every write is on the disk before anything else happens.
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

    Only one process may write it at a time, in a `locked` block. `charges` holds the costs of its
    jobs, `measured` their results and `steps` the steps played. Without `checked`, only its
    attributes may be read.

    Raises:
        LiveError: the folder holds no readable journal; every method may raise it.
    """

    def __init__(self, folder: Path, *, checked: bool = True):
        self.folder, self.path = folder, folder / FILE
        if not self.path.is_file():
            raise LiveError(f"There is no run in {folder}.", "`qcompile runs` lists the runs.")
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
        """Read the fixed attributes of the run; return the journal's format."""
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
            raise ValueError("an ID, a kind, a time or a version is not valid")
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
        """A new run in its own folder in `runs`, named by time and `name`; or in `folder`.

        Raises:
            BudgetError: the limit is not a positive number of seconds, or is too large.
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
        """Lock the run: no other process may resume it in the meantime.

        Raises:
            LiveError: another process has locked it, or it is damaged.
        """
        with home.one_process(self.id, self.folder):
            check_pages(self._db.connection, self.path)
            self._renew()
            holder = os.getpid()
            self.move_here(holder)
            try:
                yield
            finally:
                if os.getpid() == holder:  # not in a fork
                    with suppress(LiveError):
                        self.move_here()

    def _renew(self) -> None:
        """Migrate the journal to the current format, and drop everything cached."""
        with reading(self.path):
            schema.migrate(self._db.connection)
        self.charges.forget_sums()
        self._jobs_done = None

    # The home of the run

    def home(self, moment: home.Moment) -> home.Home | None:
        """Where the run began or was last resumed; None if the journal does not say."""
        with reading(self.path):
            return home.read(self._db.connection, moment)

    def move_here(self, process: int | None = None) -> None:
        """Make this folder on this machine the home of the run."""
        with reading(self.path):
            home.note(
                self._db.connection,
                "last",
                replace(home.here(self.id, self.folder), process=process),
            )

    # The run

    @property
    def max_qpu_seconds(self) -> float:
        """The limit; the largest allowed one if the first version recorded it as infinite."""
        return min(float(self._db.rows("SELECT max_qpu_seconds FROM run")[0][0]), MAX_QPU_SECONDS)

    def allow(self, max_qpu_seconds: float) -> None:
        """Set another limit.

        Raises:
            BudgetError: the limit is not a positive number of seconds, or is too large.
        """
        check_limit(max_qpu_seconds)
        self._db.do("UPDATE run SET max_qpu_seconds = ?", max_qpu_seconds)

    @property
    def result(self) -> dict[str, Any] | None:
        """The result of the run, once it is finished."""
        text = self._db.rows("SELECT result FROM run")[0][0]
        with reading(self.path):
            return None if text is None else json_object(text)

    def finish(self, result: dict[str, Any]) -> None:
        self._db.do("UPDATE run SET result = ?", json.dumps(result))

    # Its submissions

    def submissions(self, where: str = "TRUE", *values: object) -> list[Submission]:
        """Every attempt that matches `where`, in order."""
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
        """The number of submissions in each state, without reading their counts."""
        return dict(self._db.rows("SELECT state, COUNT(*) FROM submission GROUP BY state"))

    def intend(
        self, number: int, digest: str, executions: int, registers: Sequence[Register] = ()
    ) -> Submission:
        """Record that job `number` is about to be sent, as a new attempt if it failed before.

        `registers` are the registers it measures.
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
        """The prefix of its jobs' tags, followed by number and attempt."""
        return f"qcompile-{self.id}-"

    def note_sending(self, submission: Submission, cap_s: int) -> Submission:
        """Record that it is being sent now, with the cap `cap_s` at which IBM is to stop it."""
        now = datetime.now(UTC)
        with self._db.at_once():
            self.charges.note_doubt(submission.number, submission.executions, cap_s, now)
            self._note(
                submission, "state = 'sending', sent_at = ?, cap_s = ?", now.isoformat(), cap_s
            )
        return replace(submission, state="sending", sent_at=now, cap_s=cap_s)

    def note_sent(self, submission: Submission, job_id: str) -> None:
        """Record the job id that IBM returned for the last submission."""
        doubt = self.charges.doubts(submission.number)[-1]
        with self._db.at_once():
            self.charges.note_job(doubt, job_id, doubt.cap_s)
            self.note_adopted(submission, job_id)

    def note_adopted(self, submission: Submission, job_id: str) -> None:
        """Record a known job as the submission's job, whose counts are awaited."""
        self._note(submission, "state = 'sent', job_id = ?", job_id)

    def note_done(self, submission: Submission, registers: Sequence[Register]) -> None:
        """Record its bits."""
        with self._db.at_once():
            self.measured.note(submission.number, registers)
            self._note(submission, "state = 'done'")
        if self._jobs_done is not None:
            self._jobs_done += 1

    def note_failed(self, submission: Submission, words: str) -> None:
        """Record that it ended without counts, with the service's `words` but without secrets."""
        self._note(submission, "state = 'failed', words = ?", quoted(words))

    def _note(self, submission: Submission, what: str, *values: object) -> None:
        self._db.do(f"UPDATE submission SET {what} WHERE tag = ?", *values, submission.tag)
