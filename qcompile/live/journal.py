"""The journal of a live run: an SQLite file in the run's folder, written before anything is sent.

A submission is written down first, with a tag that finds its job again; then its job's id; then its
counts and usage. Every write is on the disk before the next thing happens.
"""

from __future__ import annotations

import json
import secrets
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from qcompile.errors import LiveError

IntArray = NDArray[np.int64]

Kind = Literal["run", "calibrate", "validate"]
State = Literal["intended", "sent", "done", "failed"]

FORMAT = "qcompile-journal-1"
FILE = "journal.sqlite"
_SCHEMA = """
CREATE TABLE run (
  format TEXT, id TEXT, kind TEXT, created TEXT, settings TEXT, max_qpu_seconds REAL, result TEXT
);
CREATE TABLE submission (
  number INTEGER, attempt INTEGER, tag TEXT UNIQUE, digest TEXT, executions INTEGER, created TEXT,
  state TEXT, job_id TEXT, usage_s REAL, ones BLOB, words TEXT, PRIMARY KEY (number, attempt)
);
CREATE TABLE step (number INTEGER PRIMARY KEY, observations BLOB, actions BLOB, rewards BLOB);
"""


@dataclass(frozen=True)
class Submission:
    """One attempt at one job of a run.

    `digest` is that of all it measures; `created` is when it was last sent; `ones` (rows, circuits)
    are its counts once it is done; `usage_s` is what IBM charged, None as long as it has not said
    so; `words` say why it failed.
    """

    number: int
    attempt: int
    tag: str
    digest: str
    executions: int
    created: datetime
    state: State
    job_id: str | None
    usage_s: float | None
    ones: IntArray | None
    words: str | None


@dataclass(frozen=True)
class Charge:
    """What one attempt costs: its executions, and what IBM charged, as far as it is known."""

    executions: int
    usage_s: float | None
    state: State


@dataclass(frozen=True)
class Step:
    """Observations (B, features) of a step, the actions (B,) taken, the rewards (B,) earned."""

    observations: NDArray[np.float64]
    actions: IntArray
    rewards: NDArray[np.float64] | None


class Journal:
    """The record of one run in `folder`; `create` starts one, `reopen` goes on with one.

    It is held by one process at a time: `held` is the block in which it may be written.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        path = folder / FILE
        if not path.is_file():
            raise LiveError(f"{folder} holds no run.", "`qcompile runs` lists the runs.")
        try:
            self._db = sqlite3.connect(path, isolation_level=None)
            self._db.execute("PRAGMA synchronous = FULL")
            row = self._db.execute("SELECT * FROM run").fetchone()
        except sqlite3.DatabaseError as error:
            raise LiveError(
                f"{path} cannot be read: {error}.", "Restore it from a copy."
            ) from error
        if row is None or row[0] != FORMAT:
            raise LiveError(f"{path} is no journal that this version of qcompile can read.")
        self.id: str = row[1]
        self.kind: Kind = row[2]
        self.created = datetime.fromisoformat(row[3])
        self.settings: dict[str, Any] = json.loads(row[4])

    @classmethod
    def create(
        cls, runs: Path, kind: Kind, name: str, settings: dict[str, Any], max_qpu_seconds: float
    ) -> Journal:
        """A new run in a folder of its own below `runs`, named by time and `name`.

        Raises:
            LiveError: the folder cannot be made.
        """
        now = datetime.now(UTC)
        words = "".join(c if c.isascii() and c.isalnum() else "-" for c in name)[:16]
        run_id = f"{now:%Y%m%d-%H%M%S}-{words}-{secrets.token_hex(3)}"
        folder = runs / run_id
        try:
            folder.mkdir(parents=True)
            db = sqlite3.connect(folder / FILE, isolation_level=None)
            with db:
                db.execute("PRAGMA journal_mode = WAL")
                db.executescript(f"BEGIN; {_SCHEMA} COMMIT;")
                values = (FORMAT, run_id, kind, now.isoformat(), json.dumps(settings))
                db.execute("INSERT INTO run VALUES (?,?,?,?,?,?,NULL)", (*values, max_qpu_seconds))
            db.close()
        except (OSError, sqlite3.Error) as error:
            raise LiveError(
                f"The run's journal cannot be written to {folder}: {error}.",
                "Nothing was sent. Choose another folder with --runs.",
            ) from error
        return cls(folder)

    @contextmanager
    def held(self) -> Iterator[Journal]:
        """Hold the run: no other process may go on with it meanwhile.

        Raises:
            LiveError: another process holds it.
        """
        try:
            with FileLock(self.folder / "lock", timeout=0):
                yield self
        except Timeout as error:
            raise LiveError(
                f"Run {self.id} is going on in another process.", "Wait for it, or stop it."
            ) from error

    # The run

    @property
    def max_qpu_seconds(self) -> float:
        return float(self._db.execute("SELECT max_qpu_seconds FROM run").fetchone()[0])

    def allow(self, max_qpu_seconds: float) -> None:
        """Set another limit."""
        self._db.execute("UPDATE run SET max_qpu_seconds = ?", (max_qpu_seconds,))

    @property
    def result(self) -> dict[str, Any] | None:
        """What the run found, once it is finished."""
        text = self._db.execute("SELECT result FROM run").fetchone()[0]
        return None if text is None else dict(json.loads(text))

    def finish(self, result: dict[str, Any]) -> None:
        self._db.execute("UPDATE run SET result = ?", (json.dumps(result),))

    # Its submissions

    def submissions(self) -> list[Submission]:
        """Every attempt, in order."""
        rows = self._db.execute("SELECT * FROM submission ORDER BY number, attempt")
        return [_submission(row) for row in rows]

    def charges(self) -> list[Charge]:
        """What every attempt costs, in order."""
        rows = self._db.execute(
            "SELECT executions, usage_s, state FROM submission ORDER BY number, attempt"
        )
        return [Charge(*row) for row in rows]

    def latest(self, number: int) -> Submission | None:
        """The last attempt at job `number` of the run."""
        row = self._db.execute(
            "SELECT * FROM submission WHERE number = ? ORDER BY attempt DESC LIMIT 1", (number,)
        ).fetchone()
        return None if row is None else _submission(row)

    def intend(self, number: int, digest: str, executions: int) -> Submission:
        """Write down that job `number` is about to be sent, once more where it failed before."""
        last = self.latest(number)
        attempt = 0 if last is None else last.attempt + 1
        tag = f"qcompile-{self.id}-{number}-{attempt}"
        now = datetime.now(UTC).isoformat()
        self._db.execute(
            "INSERT INTO submission VALUES (?,?,?,?,?,?,'intended',NULL,NULL,NULL,NULL)",
            (number, attempt, tag, digest, executions, now),
        )
        made = self.latest(number)
        assert made is not None
        return made

    def note_sending(self, made: Submission) -> None:
        """It is being sent now."""
        self._update(made, "created = ?", datetime.now(UTC).isoformat())

    def note_sent(self, made: Submission, job_id: str) -> None:
        """The job of a submission is known by `job_id`."""
        self._update(made, "state = 'sent', job_id = ?", job_id)

    def note_done(self, made: Submission, ones: IntArray, usage_s: float | None) -> None:
        """Its counts are here."""
        self._update(made, "state = 'done', ones = ?, usage_s = ?", _bytes(ones), usage_s)

    def note_failed(self, made: Submission, words: str, usage_s: float | None) -> None:
        """It ended without counts."""
        self._update(made, "state = 'failed', words = ?, usage_s = ?", words, usage_s)

    def _update(self, made: Submission, what: str, *values: object) -> None:
        self._db.execute(f"UPDATE submission SET {what} WHERE tag = ?", (*values, made.tag))

    # Its steps

    def step(self, number: int) -> Step | None:
        """Step `number` of the lockstep, if it was taken."""
        row = self._db.execute(
            "SELECT observations, actions, rewards FROM step WHERE number = ?", (number,)
        ).fetchone()
        return None if row is None else Step(*(None if b is None else _array(b) for b in row))  # type: ignore[arg-type]

    def note_actions(
        self, number: int, observations: NDArray[np.float64], actions: NDArray[np.intp]
    ) -> None:
        """The actions (B,) of a step for its observations (B, features)."""
        values = (number, _bytes(observations), _bytes(actions.astype(np.int64)))
        self._db.execute("INSERT INTO step VALUES (?,?,?,NULL)", values)

    def note_rewards(self, number: int, rewards: list[float]) -> None:
        """What the actions of a step earned."""
        values = (_bytes(np.array(rewards)), number)
        self._db.execute("UPDATE step SET rewards = ? WHERE number = ?", values)

    def step_count(self) -> int:
        return int(self._db.execute("SELECT COUNT(*) FROM step").fetchone()[0])

    def close(self) -> None:
        self._db.close()


def _submission(row: tuple[Any, ...]) -> Submission:
    number, attempt, tag, digest, executions, created, state, job_id, usage_s, ones, words = row
    return Submission(
        number,
        attempt,
        tag,
        digest,
        executions,
        datetime.fromisoformat(created),
        state,
        job_id,
        usage_s,
        None if ones is None else _array(ones),
        words,
    )


def _bytes(array: NDArray[Any]) -> bytes:
    file = BytesIO()
    np.save(file, array, allow_pickle=False)
    return file.getvalue()


def _array(contents: bytes) -> NDArray[Any]:
    return np.asarray(np.load(BytesIO(contents), allow_pickle=False))


def journals(runs: Path) -> list[Journal]:
    """Every run below `runs`, the newest last; folders without a journal are passed over."""
    found = [Journal(path.parent) for path in runs.glob(f"*/{FILE}")]
    return sorted(found, key=lambda journal: journal.created)


def find_journal(runs: Path, run_id: str) -> Journal:
    """The run whose id is, begins or ends with `run_id`; `last` is the newest.

    Raises:
        LiveError: there is none, or there are several.
    """
    known = [path.parent.name for path in sorted(runs.glob(f"*/{FILE}"))]
    if run_id in known:
        return Journal(runs / run_id)
    if run_id == "last":
        found = [journal.folder.name for journal in journals(runs)[-1:]]
    else:
        found = [name for name in known if run_id and run_id in name]
    if len(found) == 1:
        return Journal(runs / found[0])
    if found:
        raise LiveError(
            f"{len(found)} runs are meant by {run_id!r}: {', '.join(found[:4])}.", "Say more of it."
        )
    raise LiveError(
        f"There is no run {run_id!r} in {runs}.",
        f"It holds {len(known)}: {', '.join(known[-4:])}." if known else "It holds none.",
        "`qcompile runs` lists them; --runs names another folder.",
    )
