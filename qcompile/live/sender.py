"""Sends each job once, under a tag recorded in the journal first, by which it can be found."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from qcompile.errors import BudgetError, LiveError, QcompileError
from qcompile.live.answers import UnreadableAnswerError
from qcompile.live.client_errors import (
    DetachedErrors,
    answered_no,
    explain_error,
    seconds_setting,
    transient,
)
from qcompile.live.connection import Connection
from qcompile.live.finder import GENERAL_TAG, Finder
from qcompile.live.journal import Journal
from qcompile.live.pace import Pace
from qcompile.live.records import Submission
from qcompile.live.remote import RemoteJobs
from qcompile.live.request import Request, tag_of

SETTLE_S = 10.0
"""The seconds that IBM gets to list a job it may have accepted, before it is sent again."""
_MAX_SENDS = 3
"""Attempts in a row at one job: each may be accepted, and counts until that is known."""


class Sender:
    """Finds the job of a submission at IBM, or else sends it.

    IBM is asked for a job with the tag before each attempt. An attempt that IBM does not answer
    with a job id leaves a doubt, whatever the answer: IBM may still have accepted the job. `cap_s`
    maps a number of executions to the seconds a job may take, or raises BudgetError; `pace` says
    when the next job may be sent.
    """

    def __init__(
        self,
        journal: Journal,
        connection: Connection,
        cap_s: Callable[[int], int],
        *,
        pace: Pace,
        batch: bool,
        say: Callable[[str], None],
    ):
        self._journal, self._connection, self._pace = journal, connection, pace
        settle_s = seconds_setting("QCOMPILE_SETTLE_SECONDS", SETTLE_S)
        self.finder = Finder(journal, RemoteJobs(connection), settle_s, say)
        self._cap_s, self._wants_batch = cap_s, batch
        self._batch: Any = None
        self._older = False

    def job_of(self, submission: Submission, request: Request) -> str:
        """The id of a submission's job.

        Raises:
            BudgetError: actual and possible charges leave no room for it.
            LiveError: IBM refuses it, or does not answer.
        """
        if submission.job_id is not None:
            return submission.job_id
        sends, remedies = 0, set[str]()
        error: Exception | None = None
        while True:
            job_id = self.finder.find(submission)
            if job_id is not None:
                return job_id
            if error is not None and not (sends < _MAX_SENDS and self._may_repeat(error, remedies)):
                raise explain_error(error) from error
            error = None
            request.check_runs_on(self._connection.name, self._connection.target())
            try:
                cap_s = self._cap_s(submission.executions)
            except BudgetError as full:
                if not self.finder.settle_doubts():
                    raise full.with_hints(*self.finder.doubt_hints()) from full
                continue
            sends += 1
            try:
                with self._pace.turn():
                    job_id = self._send(self._journal.note_sending(submission, cap_s), request)
            except QcompileError:
                raise
            except Exception as failure:  # the client raises many types
                error = failure
            else:
                return self._earliest(submission, job_id)

    def close(self) -> None:
        """Close the batch, if one is open.

        Raises:
            LiveError: it cannot be closed; IBM closes it after a while.
        """
        if self._batch is not None:
            self._connection.ask(lambda service: self._batch.close(), about="the batch")

    def _send(self, submission: Submission, request: Request) -> str:
        """Send a job, record the outcome, and return the job's id."""
        sent_before = self._connection.submissions
        try:
            with DetachedErrors():
                job_id = self._submit(submission, request)
        except Exception as error:
            doubt = self._journal.charges.doubts(submission.number)[-1]
            if self._connection.submissions == sent_before:
                self._journal.charges.drop(doubt)
            else:
                now, refused = datetime.now(UTC), answered_no(error)
                self._journal.charges.note_unanswered(doubt, now, refused=refused)
            raise
        self._journal.note_sent(submission, job_id)
        return job_id

    def _submit(self, submission: Submission, request: Request) -> str:
        backend = self._connection.backend
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # deprecations concern qcompile's developers
            sampler = self._sampler(backend)
            sampler.options.environment.job_tags = [
                GENERAL_TAG,
                submission.tag,
                tag_of(request.digest),
            ]
            sampler.options.max_execution_time = submission.cap_s
            job_id = sampler.run(list(request.pubs), shots=request.shots).job_id()
        if not isinstance(job_id, str) or not job_id:
            raise UnreadableAnswerError("a submitted job")
        return job_id

    def _sampler(self, backend: Any) -> Any:
        """IBM's current sampler, or the package's top-level one if that is not served."""
        import qiskit_ibm_runtime

        if self._wants_batch and self._batch is None:
            self._batch = qiskit_ibm_runtime.Batch(backend)
        mode = self._batch or backend
        try:
            from qiskit_ibm_runtime.executor_sampler import Sampler
        except ImportError:
            return qiskit_ibm_runtime.SamplerV2(mode=mode)
        return qiskit_ibm_runtime.SamplerV2(mode=mode) if self._older else Sampler(mode=mode)

    def _earliest(self, submission: Submission, job_id: str) -> str:
        """The first job of a submission that was in doubt before; else this one."""
        if not self._journal.charges.doubts(submission.number):
            return job_id
        try:
            return self.finder.find(submission) or job_id
        except LiveError:  # it is looked up again when this one has ended
            return job_id

    def _may_repeat(self, error: Exception, remedies: set[str]) -> bool:
        """Whether to send a job again after an error; each remedy is tried once."""
        from qiskit.providers.exceptions import QiskitBackendNotFoundError
        from qiskit_ibm_runtime.exceptions import IBMNotAuthorizedError, RuntimeProgramNotFound

        if isinstance(error, QiskitBackendNotFoundError):  # before anything was sent
            self._connection.refresh_backend()
            return True
        if transient(error):
            return True
        if isinstance(error, IBMNotAuthorizedError):
            remedy = "login"
            self._connection.log_in_again()
        elif isinstance(error, RuntimeProgramNotFound):
            remedy = "sampler"
            self._older = True
        elif self._batch is not None:
            remedy = "batch"
            self._batch = None  # it may have closed: batches end after a while
        else:
            return False
        is_new = remedy not in remedies
        remedies.add(remedy)
        return is_new
