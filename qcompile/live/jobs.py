"""The jobs of a run, one after the other: from the journal, or sent, waited for and fetched."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from qcompile.errors import BudgetError, LiveError, PaidFailureError, ReplayError
from qcompile.live.answers import RemoteJob, UnreadableAnswerError
from qcompile.live.billing import Billing
from qcompile.live.budget import Budget
from qcompile.live.connection import Connection
from qcompile.live.journal import Journal
from qcompile.live.old_counts import bits_of_ones
from qcompile.live.pace import Pace
from qcompile.live.progress import Queue
from qcompile.live.records import Register, Submission
from qcompile.live.remote import JobGoneError, RemoteJobs
from qcompile.live.request import Request, is_same, measured
from qcompile.live.sender import Sender

_SLOWEST_POLL_S = 2.0
_MOST_ATTEMPTS = 3
_MOST_FETCHES = 4
_FETCH_PAUSE_S = 0.2


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
        self._billing = Billing(journal, self._remote, self.budget, say)
        self._sender = Sender(
            journal, connection, self._billing.cap_s, pace=self.pace, batch=batch, say=say
        )
        self._finder = self._sender.finder
        self._next = 0

    @property
    def next(self) -> int:
        """The number of the run's next job."""
        return self._next

    def go_back(self, number: int) -> None:
        """The next job is number `number` once more."""
        self._next = number

    def send(self, request: Request) -> int:
        """The number of the run's next job, once the journal has its bits or IBM the job.

        Raises:
            BudgetError: it would pass the limit.
            LiveError: it cannot be sent now; the run can be resumed later.
            PaidFailureError: it was charged and gave no counts, and may not be sent again.
            ReplayError: the journal has another job in this place.
        """
        number = self._next
        self._check_same(number, request)
        submission = self.journal.latest(number)
        if submission is None or submission.state != "done":
            self._job_of(submission, number, request)
        self._next = number + 1
        return number

    def bits(self, number: int, request: Request) -> list[Register]:
        """What job `number`, which was sent, has measured, of the journal or of the machine.

        Raises:
            BudgetError: it was cut off at the limit.
            LiveError: it cannot be fetched now; the run can be resumed later.
            PaidFailureError: it was charged and gave no counts, and may not be sent again.
        """
        submission = self.journal.latest(number)
        while submission is None or submission.state != "done":
            job_id = self._job_of(submission, number, request)
            sent = self.journal.latest(number)
            assert sent is not None
            self._settle(sent, job_id, request.registers)
            submission = self.journal.latest(number)
        return self._recorded(submission, request)

    def fetch(self) -> None:
        """Fetch the bits of every job that was sent, or that IBM has; none is sent.

        Raises:
            BudgetError, LiveError: one cannot be fetched.
        """
        waiting = "state IN ('sending', 'sent')"
        for number in dict.fromkeys(made.number for made in self.journal.submissions(waiting)):
            submission = self.journal.attempts(number)[-1]
            job_id = submission.job_id or self._finder.find(submission)
            if job_id is not None and submission.state in ("sending", "sent"):
                sent = self.journal.attempts(number)[-1]
                self._settle(sent, job_id, self.journal.measured.of(number))

    def _check_same(self, number: int, request: Request) -> None:
        """Nothing, if the journal has this job in this place, or none that was paid for.

        Raises:
            ReplayError: it has another one.
        """
        found = self.journal.latest(number)
        if found is None:
            return
        if is_same(found.digest, request.digest):
            if found.executions == request.executions:
                return
        elif found.state == "failed":
            return
        elif found.state == "intended" or (
            found.state == "sending" and not self.journal.charges.doubts(number)
        ):
            self.journal.note_failed(found, "Another one was asked for before it was sent.")
            return
        raise ReplayError(
            f"Job {number} of run {self.journal.id} was another one when it was sent.",
            *(self._finder.doubt_hints() if found.state == "sending" else ()),
        )

    def _job_of(self, last: Submission | None, number: int, request: Request) -> str:
        """The id of the job of a place of the run whose last attempt is given."""
        if last is None or last.state == "failed":
            self._check_unpaid(last)
            last = self.journal.intend(
                number, request.digest, request.executions, request.registers
            )
        return self._sender.job_of(last, request)

    def _recorded(self, submission: Submission, request: Request) -> list[Register]:
        """What the journal has of a job that is done, held to what was asked for.

        Raises:
            LiveError: it is of another shape.
        """
        registers, asked = self.journal.measured.of(submission.number), request.registers
        try:
            if not registers and submission.ones is not None:
                return bits_of_ones(submission.ones, request)
            if [replace(register, packed=None) for register in registers] != asked:
                raise ValueError("registers of another shape")
            for register in registers:
                register.bits  # noqa: B018
        except ValueError as error:
            raise LiveError(
                f"{self.journal.path} is damaged: the counts of a job are wrong.",
                "Restore a copy.",
            ) from error
        return registers

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
            self._finder.reconcile()
        except LiveError as error:
            self._say(str(error))
        self._billing.settle()

    def _check_unpaid(self, failed: Submission | None) -> None:
        """Nothing, if the attempt before was not charged, or may be paid for again.

        Raises:
            PaidFailureError: it was charged, or IBM has not said that it was not.
        """
        if failed is None or failed.job_id is None or self._pay_again:
            return
        charged_s = self._billing.charge_s(failed.job_id)
        if charged_s != 0:
            raise PaidFailureError(
                f"Job {failed.job_id} gave no counts. IBM says: {failed.words}",
                f"It {_charge_text(charged_s)}. It is sent and paid again only if you say so.",
            )

    def _settle(self, submission: Submission, job_id: str, registers: Sequence[Register]) -> None:
        """Wait for the job and write down how it ended: counts first, then its charge.

        Raises:
            BudgetError: IBM cut it off.
            LiveError: it was cancelled, or failed too often, or its result cannot be read.
        """
        job = self._await_end(submission, job_id)
        if job.is_done:
            self.journal.note_done(submission, self._fetch(job_id, registers))
            self._billing.ask(self.journal.charges.of_job(job_id))
            self._finder.cancel_duplicates(submission)
            return
        expected_s = self.budget.expected_s(submission.executions)  # and not after what it took
        self.journal.note_failed(submission, job.reason)
        self._finder.cancel_duplicates(submission)
        charged_s = self._billing.charge_s(job_id)
        charge = f"It {_charge_text(charged_s)}; this was attempt {submission.attempt + 1}."
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

    def _fetch(self, job_id: str, registers: Sequence[Register]) -> list[Register]:
        """What a finished job has measured.

        Raises:
            LiveError: the service does not answer, or its results are not readable several times.
        """
        for fetch in range(_MOST_FETCHES):
            try:
                return measured(registers, self._remote.result(job_id))
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


def _charge_text(charged_s: float | None) -> str:
    return "may be charged yet" if charged_s is None else f"was charged {charged_s:g} s"
