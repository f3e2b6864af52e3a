"""A job is sent once: under a tag that is in the journal before, by which it is found again."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

from qcompile.errors import BudgetError, LiveError
from qcompile.live.connection import Connection
from qcompile.live.journal import Journal
from qcompile.live.records import Submission
from qcompile.live.request import Request
from qcompile.live.words import (
    TOO_MANY_REQUESTS,
    in_words,
    refused,
    seconds_setting,
    status_code,
)

SETTLE_S = 10.0
"""A job that IBM does not list so long after it was sent was not accepted."""
_MOST_SENDS = 5
_LOOKS = 3


class Sender:
    """Gets the job of a submission: the one that IBM has, or else a new one.

    Where it is not known whether a job was accepted (a crash, a lost answer) it is looked for by
    its tag, and only sent again when IBM does not list it after SETTLE_S.
    """

    def __init__(
        self, journal: Journal, connection: Connection, batch: bool, say: Callable[[str], None]
    ):
        self._journal, self._connection, self._say = journal, connection, say
        self._settle_s = seconds_setting("QCOMPILE_SETTLE_SECONDS", SETTLE_S)
        self._wants_batch = batch
        self._batch: Any = None
        self._older = False
        self._may_be_behind = True

    def job_of(
        self, submission: Submission, request: Request, cap_s: Callable[[Submission], int]
    ) -> Any:
        """The job of a submission. `cap_s` says what one that is sent may take.

        Raises:
            BudgetError: what `cap_s` raises.
            LiveError: IBM refuses it, or does not answer, or has it no more.
        """
        if submission.job_id is not None:
            return self._still_there(submission, submission.job_id)
        unanswered = submission.state == "sending"
        job = None
        if unanswered:
            job = self._settled(submission)
            self._journal.clear_doubt(submission)  # looked for again after a new start: none
        elif self._may_be_behind:  # the journal may be a copy from before the run went on
            job = self._tagged(submission)
        self._may_be_behind = job is not None
        if job is not None:
            return job
        return self._sent(submission, request, cap_s, unanswered)

    def known(self, job_id: str) -> Any:
        """The job of this id.

        Raises:
            LiveError: IBM has it no more, or does not answer.
        """
        return self._connection.ask(lambda service: service.job(job_id))

    def resolve(self, submission: Submission, job: Any) -> None:
        """Find and count any other job of a submission whose `job` ended, where one is feared."""
        if self._journal.in_doubt(submission):
            found = self._with_tag(submission)
            self._drop(submission, [one for one in found if one.job_id() != job.job_id()])
            self._journal.clear_doubt(submission)

    def close(self) -> None:
        """Close the batch, if one was opened."""
        if self._batch is None:
            return
        try:
            self._connection.ask(lambda service: self._batch.close())
        except LiveError:
            self._say("the batch could not be closed; IBM closes it after a while")

    def _sent(
        self,
        submission: Submission,
        request: Request,
        cap_s: Callable[[Submission], int],
        unanswered: bool,
    ) -> Any:
        """A new job; `unanswered` says that IBM may have accepted one of the submission before."""
        from qiskit.exceptions import QiskitError
        from qiskit.providers.exceptions import QiskitBackendNotFoundError
        from requests import RequestException

        tried: set[str] = set()
        for _ in range(_MOST_SENDS):
            try:
                cap = cap_s(submission)
            except BudgetError as error:
                if not self._journal.in_doubt(submission):
                    raise
                found = self._looked_for(submission)
                if found is not None:
                    return found
                hint = (
                    "A job that IBM did not answer may be charged yet; going on looks for it anew."
                )
                raise error.with_hints(hint) from error
            submission = self._journal.note_sending(submission, cap)
            try:
                job = self._send(submission, request)
            except LiveError:
                raise
            except QiskitBackendNotFoundError as error:  # before anything was sent
                last: Exception = error
                self._connection.look_again()
            except (QiskitError, RequestException, OSError, ValueError) as error:
                last = error
                if refused(error):
                    if self._another_way(error, tried):
                        continue
                    if not unanswered:
                        self._journal.note_failed(submission, str(in_words(error)), 0.0)
                    raise in_words(error) from error
                self._say("no answer to a job; looking whether it was accepted")
                found = self._settled(submission)
                if found is not None:
                    return found
                if status_code(error) != TOO_MANY_REQUESTS:
                    unanswered = True
                    self._journal.note_doubt(submission)
            else:
                found = self._tagged(submission) if unanswered else None
                if found is None:
                    self._journal.note_sent(submission, job.job_id())
                return found or job
        raise in_words(last) from last

    def _send(self, submission: Submission, request: Request) -> Any:
        backend = self._connection.backend
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # deprecations are the business of who writes qcompile
            sampler = self._sampler(backend)
            sampler.options.environment.job_tags = ["qcompile", submission.tag]
            sampler.options.max_execution_time = submission.cap_s
            return sampler.run(request.pubs(), shots=request.shots)

    def _sampler(self, backend: Any) -> Any:
        """IBM's sampler of today; the one of the package's top level where it is not served."""
        import qiskit_ibm_runtime

        if self._wants_batch and self._batch is None:
            self._batch = qiskit_ibm_runtime.Batch(backend)
        mode = self._batch or backend
        try:
            from qiskit_ibm_runtime.executor_sampler import Sampler
        except ImportError:
            return qiskit_ibm_runtime.SamplerV2(mode=mode)
        return qiskit_ibm_runtime.SamplerV2(mode=mode) if self._older else Sampler(mode=mode)

    def _another_way(self, error: BaseException, tried: set[str]) -> bool:
        """Whether there is something else to try, each once, where IBM refuses a job."""
        from qiskit_ibm_runtime.exceptions import IBMNotAuthorizedError, RuntimeProgramNotFound

        if isinstance(error, IBMNotAuthorizedError):
            way = "login"
            self._connection.log_in_again()
        elif isinstance(error, RuntimeProgramNotFound):
            way = "sampler"
            self._older = True
        elif self._batch is not None:
            way = "batch"
            self._batch = None  # it may be closed: batches end after a while
        else:
            return False
        new = way not in tried
        tried.add(way)
        return new

    def _still_there(self, submission: Submission, job_id: str) -> Any:
        from qiskit_ibm_runtime.exceptions import RuntimeJobNotFound

        try:
            return self.known(job_id)
        except LiveError as error:
            if not isinstance(error.__cause__, RuntimeJobNotFound):
                raise
            self._journal.note_failed(submission, "IBM has it no more.", None)
            raise LiveError(
                f"IBM has no job {job_id} any more: somebody deleted it.",
                "To go on is to send it once more, and to pay for it again.",
            ) from error

    def _settled(self, submission: Submission) -> Any:
        """The job of a submission that may have been accepted, once IBM would list it."""
        time.sleep(self._settle_s)
        return self._tagged(submission)

    def _looked_for(self, submission: Submission) -> Any:
        """The job that was feared to be listed late, after more looks; None where there is none."""
        looks = (self._settled(submission) for _ in range(_LOOKS))
        return next((job for job in looks if job is not None), None)

    def _tagged(self, submission: Submission) -> Any:
        """The first job with the submission's tag, written down, as is any other; None if none.

        Another one is cancelled; what it was charged counts.
        """
        jobs = self._with_tag(submission)
        if not jobs:
            return None
        self._drop(submission, jobs[1:])
        self._journal.note_sent(submission, jobs[0].job_id())
        return jobs[0]

    def _with_tag(self, submission: Submission) -> list[Any]:
        """The jobs that IBM lists with the submission's tag, the first one first."""
        tags = [submission.tag]
        jobs = self._connection.ask(lambda service: service.jobs(limit=None, job_tags=tags))
        return sorted(jobs, key=lambda job: job.creation_date)

    def _drop(self, submission: Submission, extras: list[Any]) -> None:
        """Cancel further jobs of a submission, and have them counted."""
        for extra in extras:
            self._journal.note_extra(submission, extra.job_id())
            self._say(f"job {extra.job_id()} is a second one of the same step; cancelling it")
            try:
                self._connection.ask(lambda service, job=extra: job.cancel())  # type: ignore[misc]
            except LiveError:
                self._say(f"job {extra.job_id()} could not be cancelled")
