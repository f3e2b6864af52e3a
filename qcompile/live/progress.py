"""Progress messages while a run waits: the machine's queue and the remaining time."""

from __future__ import annotations

import time

from qcompile.errors import LiveError
from qcompile.live.client_errors import duration
from qcompile.live.connection import Connection

_QUEUE_AFTER_S, _QUEUE_EVERY_S = 5.0, 30.0


class Queue:
    """The length of the machine's queue, looked up now and then while a job of the run waits."""

    def __init__(self, connection: Connection):
        self._connection = connection
        self._asked_at = -_QUEUE_EVERY_S
        self._words = ""

    def words(self, waited_s: float) -> str:
        """A few words on the queue; empty if IBM does not say, or the job has just joined it."""
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
    """The remaining time of a run, estimated from its jobs in this process.

    `planned` is the expected number of jobs, `job_s` the shortest time per job that the pace
    allows. The `before` jobs already in the journal do not count: they took no time.
    """

    def __init__(self, planned: int, before: int, job_s: float = 0.0):
        self._planned, self._before, self._job_s = planned, before, job_s
        self._began = time.monotonic()

    def seconds(self, done: int) -> float | None:
        """The seconds left; None before the first job of this process, and beyond the plan."""
        left, done_here = self._planned - done, done - self._before
        if done_here < 1 or left < 1:
            return None
        return left * max((time.monotonic() - self._began) / done_here, self._job_s)

    def words(self, done: int) -> str:
        """The remaining time in words; empty if unknown."""
        if done >= self._planned > 0:
            return "more jobs than planned" if done > self._planned else ""
        seconds = self.seconds(done)
        return "" if seconds is None else f"about {duration(seconds)} left"
