"""The jobs of a run, one after the other: from the journal, or sent, waited for and fetched."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from qcompile.errors import BudgetError, LiveError, ReplayError
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
_FETCH_PAUSE_S = 0.2
_CHARGE_PAUSES_S = (0.1, 0.3, 1.0, 3.0)
_MOST_UNCHARGED = 20
_FINAL = ("DONE", "CANCELLED", "ERROR")


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
            LiveError: it cannot be had now; the run can go on later.
            ReplayError: the journal has another job in this place.
        """
        number, self._next = self._next, self._next + 1
        submission = self.journal.latest(number)
        if submission is not None and submission.digest != request.digest:
            raise ReplayError(
                f"Job {number} of run {self.journal.id} was another one when it was sent."
            )
        while submission is None or submission.ones is None:
            if submission is None or submission.state == "failed":
                submission = self.journal.intend(number, request.digest, request.executions)
            job = self._sender.job_of(submission, request, self._cap_s)
            self._settle(self.journal.latest(number) or submission, job, request)
            submission = self.journal.latest(number)
        return submission.ones

    def close(self) -> None:
        """Nothing more is asked for."""
        self._sender.close()

    def await_charges(self) -> None:
        """Ask what was charged, and wait some seconds for it where IBM does not say so at once."""
        for pause_s in _CHARGE_PAUSES_S:
            if not self.journal.uncharged():
                return
            self._say("waiting for what IBM charges")
            time.sleep(pause_s)
            self.learn_charges()

    def learn_charges(self) -> None:
        """Ask what jobs were charged whose charge was not known when they ended.

        IBM may have lost one, or not answer: then it stays unknown.
        """
        from qiskit_ibm_runtime.exceptions import RuntimeJobNotFound

        for job_id in self.journal.uncharged():
            try:
                charged_s = self._charged_s(self._sender.known(job_id))
            except LiveError as error:
                if isinstance(error.__cause__, RuntimeJobNotFound):
                    continue
                return
            if charged_s is not None:
                self.journal.note_charge(job_id, charged_s)

    def _cap_s(self, submission: Submission) -> int:
        """What a job may take; charges that are not known yet are waited for where they matter."""
        if len(self.journal.uncharged()) >= _MOST_UNCHARGED:
            self.learn_charges()
        for pause_s in _CHARGE_PAUSES_S:
            try:
                return self.budget.cap_s(submission)
            except BudgetError:
                if not self.journal.uncharged():
                    raise
            self._say("waiting for what IBM charges")
            time.sleep(pause_s)
            self.learn_charges()
        return self.budget.cap_s(submission)

    def _settle(self, submission: Submission, job: Any, request: Request) -> None:
        """Wait for the job and write down how it ended.

        Raises:
            BudgetError: IBM cut it off.
            LiveError: it was cancelled, or failed too often, or its result cannot be read.
        """
        status = self._awaited(job)
        self._sender.resolve(submission, job)
        if status == "DONE":
            ones = self._fetched(job, request)
            self.journal.note_done(submission, ones, self._charged_s(job))
            return
        words, too_long = self._failure(job)
        charged_s = self._charged_s(job)
        expected_s = self.budget.expected_s(submission.executions)  # and not after what it took
        self.journal.note_failed(submission, words, charged_s)
        if too_long:
            raise BudgetError(
                f"IBM cut job {job.job_id()} off at {submission.cap_s} s.",
                f"It was expected to take {expected_s:.1f} s.",
            )
        if status == "CANCELLED":
            raise LiveError(f"Job {job.job_id()} was cancelled.")
        if charged_s != 0 or submission.attempt + 1 >= _MOST_ATTEMPTS:
            charge = "not yet said what" if charged_s is None else f"charged {charged_s:g} s"
            raise LiveError(
                f"Job {job.job_id()} failed: {words}",
                f"IBM has {charge} for it; this was attempt {submission.attempt + 1}.",
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
            self._say(f"job {status.lower()} {waited_s:.0f} s")
            if self._max_wait_s is not None and waited_s > self._max_wait_s:
                raise LiveError(
                    f"Job {job.job_id()} is {status.lower()} for {waited_s:.0f} s now.",
                    "It stays there, and is fetched once it is done.",
                )
            time.sleep(pause_s)
            pause_s = min(1.5 * pause_s, _SLOWEST_POLL_S)

    def _failure(self, job: Any) -> tuple[str, bool]:
        """Why a job ended without a result, in words, and whether it took too long."""
        from qiskit.exceptions import QiskitError
        from qiskit_ibm_runtime.exceptions import RuntimeJobMaxTimeoutError

        try:
            job.result()
        except QiskitError as error:
            words = " ".join(str(error.message).split())[:300]
            return words, isinstance(error, RuntimeJobMaxTimeoutError)
        return "IBM gives no reason.", False

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
                time.sleep(_FETCH_PAUSE_S * 2**fetch)
        raise LiveError(
            f"The result of job {job.job_id()} cannot be read, {_MOST_FETCHES} times.",
            f"Last: {type(last).__name__}: {' '.join(str(last).split())[:200]}",
            "It is paid and is not sent again.",
        ) from last

    def _charged_s(self, job: Any) -> float | None:
        """What IBM charged for an ended job; None as long as it does not say."""
        usage = self._connection.ask(lambda service: job.metrics()).get("usage") or {}
        seconds: float | None = usage.get("qpu_charge_time_seconds")
        return None if usage.get("status", "pending") == "pending" else seconds
