"""What is told while a run waits: the queue of the machine, and the time to the end."""

from __future__ import annotations

import time

from qcompile.errors import LiveError
from qcompile.live.client_errors import duration
from qcompile.live.connection import Connection

_QUEUE_AFTER_S, _QUEUE_EVERY_S = 5.0, 30.0


class Queue:
    """How many jobs wait for the machine, asked now and then while one of the run does."""

    def __init__(self, connection: Connection):
        self._connection = connection
        self._asked_at = -_QUEUE_EVERY_S
        self._words = ""

    def words(self, waited_s: float) -> str:
        """A few words on it; empty where IBM does not say, or the job is new to the queue."""
        if waited_s < _QUEUE_AFTER_S:
            return ""
        if time.monotonic() - self._asked_at >= _QUEUE_EVERY_S:
            self._words = self._ask()
            self._asked_at = time.monotonic()
        return self._words

    def _ask(self) -> str:
        backend = self._connection.backend
        try:
            waiting = self._connection.ask(
                lambda service: int(backend.status().pending_jobs), about="queue", patient=False
            )
        except LiveError:
            return ""
        return f"{waiting} jobs in the queue" if waiting > 1 else "next in the queue"


class Remaining:
    """The time to the end of a run, from how long its jobs took in this process.

    `planned` are all jobs that it is expected to take, `job_s` the least that its pace allows for
    one. Jobs that were in the journal before are not counted: they took no time.
    """

    def __init__(self, planned: int, before: int, job_s: float = 0.0):
        self._planned, self._before, self._job_s = planned, before, job_s
        self._began = time.monotonic()

    def seconds(self, done: int) -> float | None:
        """None before the first job of this process is done, and beyond the plan."""
        left, own = self._planned - done, done - self._before
        if own < 1 or left < 1:
            return None
        return left * max((time.monotonic() - self._began) / own, self._job_s)

    def words(self, done: int) -> str:
        """The time in words; empty where it cannot be told."""
        if done >= self._planned > 0:
            return "longer than planned" if done > self._planned else ""
        seconds = self.seconds(done)
        return "" if seconds is None else f"about {duration(seconds)} to the end"
