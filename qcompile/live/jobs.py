"""The jobs of a run, one after the other: from the journal, or sent, waited for and fetched."""

from __future__ import annotations

import time
from collections.abc import Callable

from qcompile.arrays import CountArray
from qcompile.errors import BudgetError, LiveError, PaidFailureError, ReplayError
from qcompile.live.answers import RemoteJob, UnreadableAnswerError
from qcompile.live.budget import Budget
from qcompile.live.connection import Connection
from qcompile.live.journal import Journal
from qcompile.live.pace import Pace
from qcompile.live.records import Charge, Submission
from qcompile.live.remote import JobGoneError, RemoteJobs
from qcompile.live.request import Request
from qcompile.live.sending import Sender
from qcompile.live.waiting import Queue

_SLOWEST_POLL_S = 2.0
_MOST_ATTEMPTS = 3
_MOST_FETCHES = 4
_FETCH_PAUSE_S = 0.2
_CHARGE_PAUSES_S = (0.1, 0.3, 1.0, 3.0)
_MOST_UNCHARGED = 20


class Jobs:
    """The jobs of a run, in the order in which they are asked for.

    A job that the journal has is not sent again: resuming a run is asking for the same jobs.
    `say` gets words on what happens. A job is waited for `max_wait_s`, or as long as it takes.
    One that was charged and gave no counts is sent again only with `pay_again`. `jobs_per_minute`
    are sent at most.
    """

    def __init__(
        self,
        journal: Journal,
        connection: Connection,
        *,
        batch: bool = False,
        max_wait_s: float | None = None,
        pay_again: bool = False,
        jobs_per_minute: int | None = None,
        say: Callable[[str], None] = lambda words: None,
    ):
        self.journal, self.budget = journal, Budget(journal)
        self.pace = Pace(journal.charges, jobs_per_minute, max_wait_s=max_wait_s, say=say)
        self._say, self._max_wait_s, self._pay_again = say, max_wait_s, pay_again
        self._remote = RemoteJobs(connection)
        self._queue = Queue(connection)
        self._sender = Sender(
            journal, connection, self._cap_s, pace=self.pace, batch=batch, say=say
        )
        self._finder = self._sender.finder
        self._next = 0

    def ones(self, request: Request) -> CountArray:
        """The counts of the run's next job, of the journal or of the machine.

        Raises:
            BudgetError: it would pass the limit, or was cut off there.
            LiveError: it cannot be had now; the run can be resumed later.
            PaidFailureError: it was charged and gave no counts, and may not be sent again.
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
                self._check_unpaid(submission)
                submission = self.journal.intend(number, request.digest, request.executions)
            job_id = self._sender.job_of(submission, request)
            self._settle(self.journal.latest(number) or submission, job_id, request)
            submission = self.journal.latest(number)
        return submission.ones

    def close(self) -> None:
        """Nothing more is asked for."""
        try:
            self._sender.close()
        except LiveError:
            self._say("the batch could not be closed; IBM closes it after a while")

    def settle(self) -> None:
        """Look over all that IBM has of the run, and ask what it charges for it.

        What it does not say within some seconds stays unknown, and counts with its cap.
        """
        try:
            self._finder.look_over()
        except LiveError as error:
            self._say(str(error))
        for pause_s in _CHARGE_PAUSES_S:
            if not self.journal.charges.uncharged():
                return
            self._wait_for_charges(pause_s)

    def _cap_s(self, executions: int) -> int:
        """What a job may take; charges that are not known yet are waited for where they matter."""
        if len(self.journal.charges.uncharged()) >= _MOST_UNCHARGED:
            self._wait_for_charges(0.0)
        for pause_s in _CHARGE_PAUSES_S:
            try:
                return self.budget.cap_s(executions)
            except BudgetError:
                if not self.journal.charges.uncharged():
                    raise
            self._wait_for_charges(pause_s)
        return self.budget.cap_s(executions)

    def _check_unpaid(self, failed: Submission | None) -> None:
        """Nothing, if the attempt before was not charged, or may be paid for again.

        Raises:
            PaidFailureError: it was charged, or IBM has not said that it was not.
        """
        if failed is None or failed.job_id is None or self._pay_again:
            return
        charged_s = self._charge_s(failed.job_id)
        if charged_s != 0:
            raise PaidFailureError(
                f"Job {failed.job_id} gave no counts. IBM says: {failed.words}",
                f"It {_in_words(charged_s)}. It is sent and paid again only if you say so.",
            )

    def _settle(self, submission: Submission, job_id: str, request: Request) -> None:
        """Wait for the job and write down how it ended: counts first, then its charge.

        Raises:
            BudgetError: IBM cut it off.
            LiveError: it was cancelled, or failed too often, or its result cannot be read.
        """
        job = self._await_end(submission, job_id)
        if job.is_done:
            self.journal.note_done(submission, self._fetch_counts(job_id, request))
            self._ask_charge(self.journal.charges.of_job(job_id))
            self._finder.sweep(submission)
            return
        expected_s = self.budget.expected_s(submission.executions)  # and not after what it took
        self.journal.note_failed(submission, job.reason)
        self._finder.sweep(submission)
        charged_s = self._charge_s(job_id)
        charge = f"It {_in_words(charged_s)}; this was attempt {submission.attempt + 1}."
        if job.was_cut_off:
            known = self.journal.charges.of_job(job_id)
            cap_s = submission.cap_s if known is None else known.cap_s
            raise BudgetError(
                f"IBM cut job {job_id} off at {cap_s:g} s.",
                f"It was expected to take {expected_s:.1f} s.",
            )
        if job.is_cancelled:
            raise LiveError(f"Job {job_id} was cancelled.", charge)
        if charged_s != 0 or submission.attempt + 1 >= _MOST_ATTEMPTS:
            raise LiveError(f"Job {job_id} failed: {job.reason}", charge)
        self._say(f"job {job_id} failed, uncharged; sending it again")

    def _await_end(self, submission: Submission, job_id: str) -> RemoteJob:
        """The job once it has ended.

        Raises:
            LiveError: it has not ended in time, or IBM has it no more.
        """
        started, pause_s = time.monotonic(), 0.05
        while True:
            try:
                job = self._remote.job(job_id)
            except JobGoneError as error:
                self.journal.note_failed(submission, "it has the job no more.")
                raise LiveError(
                    f"IBM has no job {job_id} any more: somebody deleted it.",
                    "Resuming sends it once more, and pays for it again.",
                ) from error
            if job.has_ended:
                return job
            status, waited_s = job.status.lower(), time.monotonic() - started
            queue = self._queue.words(waited_s) if job.status == "QUEUED" else ""
            self._say(", ".join(filter(None, (f"job {status} {waited_s:.0f} s", queue))))
            if self._max_wait_s is not None and waited_s > self._max_wait_s:
                raise LiveError(
                    f"Job {job_id} is {status} for {waited_s:.0f} s now.",
                    "It stays there, and is fetched once it is done.",
                )
            time.sleep(pause_s)
            pause_s = min(1.5 * pause_s, _SLOWEST_POLL_S)

    def _fetch_counts(self, job_id: str, request: Request) -> CountArray:
        """The counts of a finished job.

        Raises:
            LiveError: the service does not answer, or its results are not readable several times.
        """
        for fetch in range(_MOST_FETCHES):
            try:
                return request.ones(self._remote.result(job_id))
            except UnreadableAnswerError as error:
                last: Exception = error
            except LiveError:
                raise
            except Exception as error:  # what a broken document breaks depends on where it broke
                last = error
            time.sleep(_FETCH_PAUSE_S * 2**fetch)
        raise LiveError(
            f"The result of job {job_id} cannot be read, {_MOST_FETCHES} times.",
            "It is paid and is not sent again: resuming fetches it once more.",
        ) from last

    def _wait_for_charges(self, pause_s: float) -> None:
        """Wait, then ask for every charge that is not known yet, as long as the service answers."""
        self._say("waiting for what IBM charges")
        time.sleep(pause_s)
        for charge in self.journal.charges.uncharged():
            if not self._ask_charge(charge):
                return

    def _charge_s(self, job_id: str) -> float | None:
        """What an ended job was charged, waited for some seconds; None if IBM has not said it."""
        for pause_s in (0.0, *_CHARGE_PAUSES_S):
            charge = self.journal.charges.of_job(job_id)
            if charge is None or charge.charged_s is not None:
                break
            time.sleep(pause_s)
            self._ask_charge(charge)
        charge = self.journal.charges.of_job(job_id)
        return None if charge is None else charge.charged_s

    def _ask_charge(self, charge: Charge | None) -> bool:
        """Ask what a job was charged and write it down; False where the service does not answer."""
        if charge is None or charge.job_id is None:
            return True
        try:
            charged_s = self._remote.charged_s(charge.job_id, charge.cap_s)
        except LiveError:
            return False
        if charged_s is not None:
            self.journal.charges.settle(charge, charged_s)
        return True


def _in_words(charged_s: float | None) -> str:
    return "may be charged yet" if charged_s is None else f"was charged {charged_s:g} s"
