"""The jobs of a run, one after the other: from the journal, or sent, waited for and fetched."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from qcompile.errors import BudgetError, LiveError
from qcompile.execution.executor import CountArray
from qcompile.live.budget import Budget
from qcompile.live.connection import Connection
from qcompile.live.journal import Journal
from qcompile.live.records import Submission
from qcompile.live.request import Request
from qcompile.live.sending import Sender

_SLOWEST_POLL_S = 2.0
_MOST_ATTEMPTS = 3
_MOST_FETCHES = 4
_FINAL = ("DONE", "CANCELLED", "ERROR")
_TOO_LONG = 1305
"""IBM's reason code of a job that passed its max_execution_time."""


class Jobs:
    """The jobs of a run, in the order in which they are asked for.

    A job that the journal has is not sent again: going on with a run is to ask for the same jobs.
    `say` gets words on what is going on. A job is waited for `max_wait_s`, or as long as it takes.
    """

    def __init__(
        self,
        journal: Journal,
        connection: Connection,
        *,
        batch: bool = False,
        max_wait_s: float | None = None,
        say: Callable[[str], None] = lambda words: None,
    ):
        self.journal, self.budget = journal, Budget(journal)
        self._connection, self._say, self._max_wait_s = connection, say, max_wait_s
        self._sender = Sender(journal, connection, batch, say)
        self._next = 0

    def ones(self, request: Request) -> CountArray:
        """The counts of the run's next job, of the journal or of the machine.

        Raises:
            BudgetError: it would pass the limit, or was cut off there.
            LiveError: it cannot be had; the run can go on later.
        """
        number, self._next = self._next, self._next + 1
        made = self.journal.latest(number)
        if made is not None and made.digest != request.digest:
            raise LiveError(
                f"Job {number} of run {self.journal.id} was another one when it was sent.",
                "The versions of qcompile, numpy and gymnasium must be those it began with.",
                f"`qcompile runs export {self.journal.id}` gives what was measured.",
            )
        while made is None or made.ones is None:
            job = None
            if made is None or made.state == "failed":
                self.learn_charges()
                self.budget.check(request.executions)
                made = self.journal.intend(number, request.digest, request.executions)
            else:
                job = self._sender.find(made)
            if job is None:
                limit_s = self.budget.allowance_s(made.executions)
                job = self._sender.send(made, request, limit_s)
            self._settle(made, job, request)
            made = self.journal.latest(number)
        return made.ones

    def close(self) -> None:
        """Nothing more is asked for."""
        self._sender.close()

    def learn_charges(self) -> None:
        """Ask what jobs were charged whose charge was not known when they ended."""
        for made in self.journal.uncharged():
            job = self._sender.find(made)
            usage_s = None if job is None else self._usage_s(job)
            if usage_s is not None:
                self.journal.note_charge(made, usage_s)

    def _settle(self, made: Submission, job: Any, request: Request) -> None:
        """Wait for the job and write down how it ended.

        Raises:
            LiveError: it was cancelled, or failed too often, or its result cannot be read.
        """
        status = self._awaited(job)
        if status == "DONE":
            ones = self._fetched(job, request)
            self.journal.note_done(made, ones, self._usage_s(job))
            return
        words = self._connection.ask(lambda service: job.error_message()) or f"it is {status}"
        words = " ".join(words.split())[:300]
        usage_s = self._usage_s(job)
        self.journal.note_failed(made, words, usage_s)
        again = f"`qcompile resume {self.journal.id}` sends it once more."
        if getattr(job, "_reason_code", None) == _TOO_LONG:
            raise BudgetError(
                f"IBM cut job {job.job_id()} off at the limit of the run.",
                f"`qcompile resume {self.journal.id} --max-qpu-seconds S` tries again with more.",
            )
        if status == "CANCELLED":
            raise LiveError(f"Job {job.job_id()} was cancelled.", again)
        if usage_s != 0 or made.attempt + 1 >= _MOST_ATTEMPTS:
            charge = "not yet said what" if usage_s is None else f"charged {usage_s:g} s"
            raise LiveError(
                f"Job {job.job_id()} failed: {words}",
                f"IBM has {charge} for it; this was attempt {made.attempt + 1}.",
                again,
            )
        self._say(f"job {job.job_id()} failed, uncharged; sending it again")

    def _awaited(self, job: Any) -> str:
        """The final status of the job."""
        started, pause_s = time.monotonic(), 0.05
        while True:
            status = str(self._connection.ask(lambda service: job.status()))
            if status in _FINAL:
                return status
            waited_s = time.monotonic() - started
            self._say(f"job {job.job_id()} is {status.lower()}, {waited_s:.0f} s")
            if self._max_wait_s is not None and waited_s > self._max_wait_s:
                raise LiveError(
                    f"Job {job.job_id()} is {status.lower()} for {waited_s:.0f} s now.",
                    f"`qcompile resume {self.journal.id}` fetches it once it is done.",
                )
            time.sleep(pause_s)
            pause_s = min(1.5 * pause_s, _SLOWEST_POLL_S)

    def _fetched(self, job: Any, request: Request) -> CountArray:
        """The counts of a finished job.

        Raises:
            LiveError: the result is not readable, several times.
        """
        for fetch in range(_MOST_FETCHES):
            try:
                return request.ones(self._connection.ask(lambda service: job.result()))
            except LiveError:
                raise
            except Exception as error:  # what a broken document breaks depends on where it broke
                last = error
                time.sleep(0.2 * 2**fetch)
        raise LiveError(
            f"The result of job {job.job_id()} cannot be read, {_MOST_FETCHES} times.",
            f"Last: {type(last).__name__}: {' '.join(str(last).split())[:200]}",
            f"It is paid and not sent again; `qcompile resume {self.journal.id}` reads it anew.",
        ) from last

    def _usage_s(self, job: Any) -> float | None:
        """What IBM charged for an ended job; None as long as it does not say."""
        usage = self._connection.ask(lambda service: job.metrics()).get("usage") or {}
        seconds: float | None = usage.get("qpu_charge_time_seconds")
        return None if usage.get("status") == "pending" else seconds
