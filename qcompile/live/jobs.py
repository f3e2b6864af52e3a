"""One job, exactly once: written down, sent, found again, waited for, fetched.

A job is sent under a tag that is in the journal before. Where it is not known whether it was
accepted (a crash, a lost answer) it is looked for by its tag, and only sent again when IBM does not
list it after SETTLE_S.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any, Protocol

from qcompile.errors import BudgetError, LiveError
from qcompile.execution.executor import CountArray
from qcompile.live.budget import Budget
from qcompile.live.connection import Connection, in_words, refused, transient
from qcompile.live.journal import Journal, Submission

SETTLE_S = float(os.environ.get("QCOMPILE_SETTLE_SECONDS", "10"))
"""A job that IBM does not list so long after it was sent was not accepted."""
_SLOWEST_POLL_S = 2.0
_MOST_ATTEMPTS = 3
_MOST_SENDS = 5
_MOST_FETCHES = 4
_FETCH_PAUSE_S = 0.2
_USAGE_POLLS = 5
_FINAL = ("DONE", "CANCELLED", "ERROR")
_TOO_LONG = 1305
"""IBM's reason code of a job that passed its max_execution_time."""


class Batch(Protocol):
    """What one job measures."""

    @property
    def digest(self) -> str:
        """The same for the same circuits, qubits, angles and shots, and for nothing else."""
        ...

    @property
    def executions(self) -> int: ...

    @property
    def shots(self) -> int: ...

    def pubs(self) -> list[Any]:
        """Circuits and their values, as SamplerV2 takes them."""
        ...

    def ones(self, result: Any) -> CountArray:
        """The ones of each circuit, (rows, circuits), of a sampler's result.

        Raises:
            ValueError: the result is not that of these pubs.
        """
        ...


class Jobs:
    """The jobs of a run, in the order in which they are asked for.

    A job that the journal has is not sent again: going on with a run is to ask for the same jobs.
    `say` gets words on what is going on.
    """

    def __init__(
        self,
        journal: Journal,
        connection: Connection,
        *,
        batch_mode: bool = False,
        max_wait_s: float | None = None,
        say: Callable[[str], None] = lambda words: None,
    ):
        self.journal, self.budget = journal, Budget(journal)
        self._connection, self._say, self._max_wait_s = connection, say, max_wait_s
        self._batch_mode = batch_mode
        self._mode: Any = None
        self._older = False
        self._tried: set[str] = set()
        self._next = 0

    def ones(self, batch: Batch) -> CountArray:
        """The counts of the run's next job, of the journal or of the machine.

        Raises:
            BudgetError: it would pass the limit, or was cut off there.
            LiveError: it cannot be had; the run can go on later.
        """
        number, self._next = self._next, self._next + 1
        made = self.journal.latest(number)
        if made is not None and made.digest != batch.digest:
            raise LiveError(
                f"Job {number} of run {self.journal.id} was another one when it was sent.",
                "The versions of qcompile, numpy and gymnasium must be those it began with.",
                f"`qcompile runs export {self.journal.id}` gives what was measured.",
            )
        while True:
            if made is not None and made.state == "done":
                assert made.ones is not None
                return made.ones
            job = None
            if made is None or made.state == "failed":
                self.budget.check(batch.executions)
                made = self.journal.intend(number, batch.digest, batch.executions)
            else:
                job = self._found(made)
            job = job or self._sent(made, batch)
            self._settle(made, job, batch)
            made = self.journal.latest(number)

    def close(self) -> None:
        """Close the batch, if one was opened."""
        if self._mode is not None:
            try:
                self._connection.ask(lambda service: self._mode.close())
            except LiveError:
                self._say("the batch could not be closed; IBM closes it after a while")

    # Sending

    def _sent(self, made: Submission, batch: Batch) -> Any:
        """The job of a submission that IBM does not have yet.

        Raises:
            LiveError: IBM refuses it, or does not answer.
        """
        from qiskit.exceptions import QiskitError
        from requests import RequestException

        for send in range(_MOST_SENDS):
            try:
                job = self._send(made, batch)
            except LiveError:
                raise
            except (QiskitError, RequestException, OSError) as error:
                last = error
                if refused(error) and not transient(error):
                    if self._another_way(error):
                        continue
                    self.journal.note_failed(made, str(in_words(error)), 0.0)
                    raise in_words(error) from error
                self._say("no answer to a job; looking whether it was accepted")
                time.sleep(SETTLE_S)
                found = self._tagged(made)
                if found is not None:
                    return found
            else:
                self.journal.note_sent(made, job.job_id())
                return job if send == 0 else self._tagged(made) or job
        raise in_words(last) from last

    def _send(self, made: Submission, batch: Batch) -> Any:
        backend = self._connection.backend
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # deprecations are the business of who writes qcompile
            sampler = self._sampler(backend)
            sampler.options.environment.job_tags = ["qcompile", made.tag]
            sampler.options.max_execution_time = self.budget.allowance_s(made.executions)
            self.journal.note_sending(made)
            return sampler.run(batch.pubs(), shots=batch.shots)

    def _sampler(self, backend: Any) -> Any:
        """IBM's sampler of today; the one of the package's top level where it is not served."""
        import qiskit_ibm_runtime

        if self._batch_mode and self._mode is None:
            self._mode = qiskit_ibm_runtime.Batch(backend)
        mode = self._mode or backend
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
        elif self._mode is not None:
            way = "batch"
            self._mode = None  # it may be closed: batches end after a while
        else:
            return False
        new = way not in self._tried
        self._tried.add(way)
        return new

    # Finding

    def _found(self, made: Submission) -> Any:
        """The job of a submission: by its id, or by its tag; None where IBM has none."""
        if made.job_id is not None:
            return self._connection.ask(lambda service: service.job(made.job_id))
        age_s = (datetime.now(UTC) - made.created).total_seconds()
        time.sleep(min(max(SETTLE_S - age_s, 0.0), SETTLE_S))
        return self._tagged(made)

    def _tagged(self, made: Submission) -> Any:
        """The first job with the submission's tag, written down; any other is cancelled."""
        jobs = self._connection.ask(lambda service: service.jobs(limit=None, job_tags=[made.tag]))
        if not jobs:
            return None
        first, *extras = sorted(jobs, key=lambda job: str(job.creation_date))
        for extra in extras:
            self._cancel(extra)
        self.journal.note_sent(made, first.job_id())
        return first

    def _cancel(self, job: Any) -> None:
        self._say(f"job {job.job_id()} is a second one of the same step; cancelling it")
        try:
            self._connection.ask(lambda service: job.cancel())
        except LiveError:
            self._say(f"job {job.job_id()} could not be cancelled")

    # Waiting and fetching

    def _settle(self, made: Submission, job: Any, batch: Batch) -> None:
        """Wait for the job and write down how it ended.

        Raises:
            LiveError: it was cancelled, or failed too often, or its result cannot be read.
        """
        status = self._awaited(job)
        if status == "DONE":
            ones = self._fetched(job, batch)
            self.journal.note_done(made, ones, self._usage_s(job))
            return
        words = self._connection.ask(lambda service: job.error_message()) or "it was cancelled"
        usage_s = self._usage_s(job)
        self.journal.note_failed(made, " ".join(words.split())[:300], usage_s)
        if getattr(job, "_reason_code", None) == _TOO_LONG:
            raise BudgetError(
                f"IBM cut job {job.job_id()} off at the limit of the run.",
                f"`qcompile resume {self.journal.id} --max-qpu-seconds S` tries again with more.",
            )
        if status == "CANCELLED":
            raise LiveError(
                f"Job {job.job_id()} was cancelled.",
                f"`qcompile resume {self.journal.id}` sends it once more.",
            )
        if usage_s or made.attempt + 1 >= _MOST_ATTEMPTS:
            raise LiveError(
                f"Job {job.job_id()} failed: {' '.join(words.split())[:300]}",
                f"IBM charged {usage_s or 0:g} s for it; this was attempt {made.attempt + 1}.",
                f"`qcompile resume {self.journal.id}` sends it once more.",
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

    def _fetched(self, job: Any, batch: Batch) -> CountArray:
        """The counts of a finished job.

        Raises:
            LiveError: the result is not readable, several times.
        """
        for fetch in range(_MOST_FETCHES):
            try:
                return batch.ones(self._connection.ask(lambda service: job.result()))
            except LiveError:
                raise
            except Exception as error:  # what a broken document breaks depends on where it broke
                last = error
                time.sleep(_FETCH_PAUSE_S * 2**fetch)
        raise LiveError(
            f"The result of job {job.job_id()} cannot be read, {_MOST_FETCHES} times.",
            f"Last: {type(last).__name__}: {' '.join(str(last).split())[:200]}",
            f"It is paid and not sent again; `qcompile resume {self.journal.id}` reads it anew.",
        ) from last

    def _usage_s(self, job: Any) -> float | None:
        """What IBM charged for an ended job; None where it does not say so soon."""
        for poll in range(_USAGE_POLLS):
            metrics = self._connection.ask(lambda service: job.metrics())
            usage = metrics.get("usage") or {}
            seconds = usage.get("qpu_charge_time_seconds")
            if seconds is not None and usage.get("status", "final") != "pending":
                return float(seconds)
            time.sleep(0.1 * 2**poll)
        return None
