"""A job is sent once: under a tag that is in the journal before, by which it is found again."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

from qcompile.errors import LiveError
from qcompile.live.connection import Connection, in_words, refused, transient
from qcompile.live.journal import Journal
from qcompile.live.records import Submission
from qcompile.live.request import Request

SETTLE_S = float(os.environ.get("QCOMPILE_SETTLE_SECONDS", "10"))
"""A job that IBM does not list so long after it was sent was not accepted."""
_MOST_SENDS = 5


class Sender:
    """Gets the job of a submission: the one that IBM has, or else a new one.

    Where it is not known whether a job was accepted (a crash, a lost answer) it is looked for by
    its tag, and only sent again when IBM does not list it after SETTLE_S.
    """

    def __init__(
        self, journal: Journal, connection: Connection, batch: bool, say: Callable[[str], None]
    ):
        self._journal, self._connection, self._say = journal, connection, say
        self._wants_batch = batch
        self._batch: Any = None
        self._older = False
        self._tried: set[str] = set()

    def find(self, made: Submission) -> Any:
        """The job of a submission: by its id, or by its tag; None where IBM has none."""
        if made.job_id is not None:
            return self._connection.ask(lambda service: service.job(made.job_id))
        age_s = (datetime.now(UTC) - made.created).total_seconds()
        time.sleep(min(max(SETTLE_S - age_s, 0.0), SETTLE_S))
        return self._tagged(made)

    def send(self, made: Submission, request: Request, limit_s: float) -> Any:
        """The job of a submission that IBM does not have; it may take `limit_s` at most.

        Raises:
            LiveError: IBM refuses it, or does not answer.
        """
        from qiskit.exceptions import QiskitError
        from requests import RequestException

        for attempt in range(_MOST_SENDS):
            try:
                job = self._send(made, request, limit_s)
            except LiveError:
                raise
            except (QiskitError, RequestException, OSError) as error:
                last = error
                if refused(error) and not transient(error):
                    if self._another_way(error):
                        continue
                    self._journal.note_failed(made, str(in_words(error)), 0.0)
                    raise in_words(error) from error
                self._say("no answer to a job; looking whether it was accepted")
                time.sleep(SETTLE_S)
                found = self._tagged(made)
                if found is not None:
                    return found
            else:
                self._journal.note_sent(made, job.job_id())
                return job if attempt == 0 else self._tagged(made) or job
        raise in_words(last) from last

    def close(self) -> None:
        """Close the batch, if one was opened."""
        if self._batch is None:
            return
        try:
            self._connection.ask(lambda service: self._batch.close())
        except LiveError:
            self._say("the batch could not be closed; IBM closes it after a while")

    def _send(self, made: Submission, request: Request, limit_s: float) -> Any:
        backend = self._connection.backend
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # deprecations are the business of who writes qcompile
            sampler = self._sampler(backend)
            sampler.options.environment.job_tags = ["qcompile", made.tag]
            sampler.options.max_execution_time = max(int(limit_s), 1)
            self._journal.note_sending(made)
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

    def _another_way(self, error: BaseException) -> bool:
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
        new = way not in self._tried
        self._tried.add(way)
        return new

    def _tagged(self, made: Submission) -> Any:
        """The first job with the submission's tag, written down; any other is cancelled."""
        jobs = self._connection.ask(lambda service: service.jobs(limit=None, job_tags=[made.tag]))
        if not jobs:
            return None
        first, *extras = sorted(jobs, key=lambda job: str(job.creation_date))
        for extra in extras:
            self._cancel(extra)
        self._journal.note_sent(made, first.job_id())
        return first

    def _cancel(self, job: Any) -> None:
        self._say(f"job {job.job_id()} is a second one of the same step; cancelling it")
        try:
            self._connection.ask(lambda service: job.cancel())
        except LiveError:
            self._say(f"job {job.job_id()} could not be cancelled")
