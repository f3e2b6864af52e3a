"""The jobs of a run in order: read from the journal, or sent, waited for and fetched."""

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
_MAX_ATTEMPTS = 3
_MAX_FETCHES = 4
_FETCH_PAUSE_S = 0.2


class Jobs:
    """The jobs of a run, in the order they are requested.

    A job that is in the journal is not sent again: a run is resumed by requesting the same jobs.
    `say` gets progress messages. A job is waited for at most `max_wait_s` seconds, without limit if
    None. A job that was charged and returned no counts is sent again only with `pay_again`. At most
    `jobs_per_minute` jobs are sent.
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
        """Make `number` the number of the next job again."""
        self._next = number

    def send(self, request: Request) -> int:
        """The number of the run's next job, once its bits are in the journal or IBM has the job.

        Raises:
            BudgetError: it would exceed the limit.
            LiveError: it cannot be sent now; the run can be resumed later.
            PaidFailureError: it was charged, returned no counts, and may not be sent again.
            ReplayError: the journal has a different job at this position.
        """
        number = self._next
        self._check_same(number, request)
        submission = self.journal.latest(number)
        if submission is None or submission.state != "done":
            self._job_of(submission, number, request)
        self._next = number + 1
        return number

    def bits(self, number: int, request: Request) -> list[Register]:
        """The bits measured by job `number`, which was sent: from the journal or the machine.

        Raises:
            BudgetError: IBM stopped it at its cap.
            LiveError: it cannot be fetched now; the run can be resumed later.
            PaidFailureError: it was charged, returned no counts, and may not be sent again.
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
        """Fetch the bits of every job that was sent or that IBM has, without sending any.

        Raises:
            BudgetError, LiveError: a job cannot be fetched.
        """
        waiting = "state IN ('sending', 'sent')"
        for number in dict.fromkeys(sent.number for sent in self.journal.submissions(waiting)):
            submission = self.journal.attempts(number)[-1]
            job_id = submission.job_id or self._finder.find(submission)
            if job_id is not None and submission.state in ("sending", "sent"):
                sent = self.journal.attempts(number)[-1]
                self._settle(sent, job_id, self.journal.measured.of(number))

    def _check_same(self, number: int, request: Request) -> None:
        """Check that the journal has this job, or no paid job, at this position.

        Raises:
            ReplayError: it has a different one.
        """
        recorded = self.journal.latest(number)
        if recorded is None:
            return
        if is_same(recorded.digest, request.digest):
            if recorded.executions == request.executions:
                return
        elif recorded.state == "failed":
            return
        elif recorded.state == "intended" or (
            recorded.state == "sending" and not self.journal.charges.doubts(number)
        ):
            self.journal.note_failed(recorded, "A different job was requested before it was sent.")
            return
        raise ReplayError(
            f"Job {number} of run {self.journal.id} differs from the one that was sent.",
            *(self._finder.doubt_hints() if recorded.state == "sending" else ()),
        )

    def _job_of(self, last: Submission | None, number: int, request: Request) -> str:
        """The id of job `number`, whose last attempt is `last`."""
        if last is None or last.state == "failed":
            self._check_unpaid(last)
            last = self.journal.intend(
                number, request.digest, request.executions, request.registers
            )
        return self._sender.job_of(last, request)

    def _recorded(self, submission: Submission, request: Request) -> list[Register]:
        """The recorded bits of a finished job, checked against the request.

        Raises:
            LiveError: their shape differs.
        """
        registers, asked = self.journal.measured.of(submission.number), request.registers
        try:
            if not registers and submission.ones is not None:
                return bits_of_ones(submission.ones, request)
            if [replace(register, packed=None) for register in registers] != asked:
                raise ValueError("registers of the wrong shape")
            for register in registers:
                register.bits  # noqa: B018
        except ValueError as error:
            raise LiveError(
                f"{self.journal.path} is damaged: the counts of a job are not valid.",
                "Restore a backup.",
            ) from error
        return registers

    def close(self) -> None:
        """Close the batch: no more jobs follow."""
        try:
            self._sender.close()
        except LiveError:
            self._say("the batch could not be closed; IBM closes it after a while")

    def settle(self) -> None:
        """Reconcile the journal with IBM's list of the run's jobs, and look up their charges.

        A charge that IBM does not report within seconds stays unknown and counts with its cap.
        """
        try:
            self._finder.reconcile()
        except LiveError as error:
            self._say(str(error))
        self._billing.settle()

    def _check_unpaid(self, failed: Submission | None) -> None:
        """Check that the previous attempt was not charged, or may be paid for again.

        Raises:
            PaidFailureError: it was charged, or may still be.
        """
        if failed is None or failed.job_id is None or self._pay_again:
            return
        charged_s = self._billing.charge_s(failed.job_id)
        if charged_s != 0:
            raise PaidFailureError(
                f"Job {failed.job_id} returned no counts. IBM says: {failed.words}",
                f"It {_charge_text(charged_s)}. It is sent and paid for again only if you allow "
                "it.",
            )

    def _settle(self, submission: Submission, job_id: str, registers: Sequence[Register]) -> None:
        """Wait for the job and record its outcome: counts first, then its charge.

        Raises:
            BudgetError: IBM stopped it at its cap.
            LiveError: it was cancelled, failed too often, or its result cannot be read.
        """
        job = self._await_end(submission, job_id)
        if job.is_done:
            self.journal.note_done(submission, self._fetch(job_id, registers))
            self._billing.ask(self.journal.charges.of_job(job_id))
            self._finder.cancel_duplicates(submission)
            return
        expected_s = self.budget.expected_s(submission.executions)  # before its own charge
        self.journal.note_failed(submission, job.reason)
        self._finder.cancel_duplicates(submission)
        charged_s = self._billing.charge_s(job_id)
        charge = f"It {_charge_text(charged_s)}; this was attempt {submission.attempt + 1}."
        if job.was_cut_off:
            recorded = self.journal.charges.of_job(job_id)
            cap_s = submission.cap_s if recorded is None else recorded.cap_s
            raise BudgetError(
                f"IBM stopped job {job_id} at {cap_s:g} s.",
                f"It was expected to take {expected_s:.1f} s.",
            )
        if job.is_cancelled:
            raise LiveError(f"Job {job_id} was cancelled.", charge)
        if charged_s != 0 or submission.attempt + 1 >= _MAX_ATTEMPTS:
            raise LiveError(f"Job {job_id} failed: {job.reason}", charge)
        self._say(f"job {job_id} failed, uncharged; sending it again")

    def _await_end(self, submission: Submission, job_id: str) -> RemoteJob:
        """The job once it has ended.

        Raises:
            LiveError: it has not ended in time, or IBM no longer has it.
        """
        started, pause_s = time.monotonic(), 0.05
        while True:
            try:
                job = self._remote.job(job_id)
            except JobGoneError as error:
                self.journal.note_failed(submission, "it no longer has the job.")
                raise LiveError(
                    f"IBM no longer has job {job_id}: it was deleted.",
                    "Resuming sends it once more and pays for it again.",
                ) from error
            if job.has_ended:
                return job
            status, waited_s = job.status.lower(), time.monotonic() - started
            queue = self._queue.words(waited_s) if job.status == "QUEUED" else ""
            self._say(", ".join(filter(None, (f"job {status} {waited_s:.0f} s", queue))))
            if self._max_wait_s is not None and waited_s > self._max_wait_s:
                raise LiveError(
                    f"Job {job_id} has been {status} for {waited_s:.0f} s.",
                    "It stays in the queue; resume to fetch it once it is done.",
                )
            time.sleep(pause_s)
            pause_s = min(1.5 * pause_s, _SLOWEST_POLL_S)

    def _fetch(self, job_id: str, registers: Sequence[Register]) -> list[Register]:
        """The bits that a finished job measured.

        Raises:
            LiveError: the service does not answer, or its result stays unreadable.
        """
        for fetch in range(_MAX_FETCHES):
            try:
                return measured(registers, self._remote.result(job_id))
            except UnreadableAnswerError as error:
                last: Exception = error
            except LiveError:
                raise
            except Exception as error:  # a damaged document can fail anywhere
                last = error
            time.sleep(_FETCH_PAUSE_S * 2**fetch)
        raise LiveError(
            f"The result of job {job_id} could not be read in {_MAX_FETCHES} attempts.",
            "It is paid for and is not sent again: resuming fetches it once more.",
        ) from last


def _charge_text(charged_s: float | None) -> str:
    return "may still be charged" if charged_s is None else f"was charged {charged_s:g} s"
