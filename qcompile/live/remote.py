"""Jobs at IBM's service: listing them by tag, their status, results and charges, and cancelling."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Any, TypeVar

from qcompile.errors import LiveError
from qcompile.live.answers import Listing, Metrics, RemoteJob, UnreadableAnswerError, read
from qcompile.live.client import clients
from qcompile.live.client_errors import NOT_FOUND, status_code
from qcompile.live.connection import Connection

T = TypeVar("T")

_PAGE, _MAX_PAGES = 200, 500


class JobGoneError(LiveError):
    """IBM no longer has a job with this id."""


class RemoteJobs:
    """The jobs at the service of a connection. Only `cancel` changes anything there."""

    def __init__(self, connection: Connection):
        self._connection = connection

    def listed(self, tag: str, since: datetime | None = None) -> list[RemoteJob]:
        """Every job with the tag, created after `since`.

        Raises:
            LiveError: no answer, or an unreliable one that has jobs without the tag or fewer than
                it says.
        """
        jobs: dict[str, RemoteJob] = {}

        def ask(service: Any) -> None:
            jobs.clear()
            for client in clients(service):
                jobs.update(_all_pages(client, tag, since))

        self._connection.ask(ask, about="the list of jobs")
        if any(tag not in (job.tags or ()) for job in jobs.values()):
            raise LiveError(
                "IBM's service lists jobs without the requested tag.",
                "It is unclear which jobs belong to this run: none was used, cancelled or sent.",
                "Resume later; everything measured is kept.",
            )
        return list(jobs.values())

    def job(self, job_id: str) -> RemoteJob:
        """The job as it is now.

        Raises:
            JobGoneError: IBM has no job with this id.
            LiveError: no answer, or one that cannot be read.
        """
        about = f"job {job_id}"
        try:
            answer = self._ask_of(lambda client: client.job_get(job_id, exclude_params=True), about)
        except LiveError as error:
            if status_code(error.__cause__) == NOT_FOUND:
                raise JobGoneError(f"IBM no longer has job {job_id}.") from error
            raise
        job = read(RemoteJob, answer, about)
        if job.id != job_id or not job.status:
            raise UnreadableAnswerError(about)
        return job

    def result(self, job_id: str) -> Any:
        """The result of a completed job, as qiskit-ibm-runtime decodes it.

        Raises:
            LiveError: no answer.
            UnreadableAnswerError: it cannot be decoded.
        """
        return self._connection.ask(
            lambda service: service.job(job_id).result(), about=f"the result of job {job_id}"
        )

    def charged_s(self, job_id: str, cap_s: float) -> float | None:
        """The charge of an ended job; None until IBM reports a possible value.

        IBM is asked only once: a charge can wait.

        Raises:
            LiveError: no answer.
        """
        about = f"the charge of job {job_id}"
        try:
            answer = self._ask_of(lambda client: client.job_metadata(job_id), about, patient=False)
            return read(Metrics, answer, about).charged_s(cap_s)
        except UnreadableAnswerError:
            return None
        except LiveError as error:
            if status_code(error.__cause__) == NOT_FOUND:
                return None
            raise

    def cancel(self, job_id: str) -> None:
        """Cancel the job.

        Raises:
            LiveError: it has ended, or there is no answer.
        """
        self._ask_of(lambda client: client.job_cancel(job_id), f"job {job_id}")

    def _ask_of(self, question: Callable[[Any], T], about: str, *, patient: bool = True) -> T:
        """The answer of the client whose instance knows the job."""
        from qiskit_ibm_runtime.api.exceptions import RequestsApiError

        def ask(service: Any) -> T:
            *others, last = clients(service)
            for client in others:
                try:
                    return question(client)
                except RequestsApiError as error:
                    if error.status_code != NOT_FOUND:
                        raise
            return question(last)

        return self._connection.ask(ask, about=about, patient=patient)


def _all_pages(client: Any, tag: str, since: datetime | None) -> dict[str, RemoteJob]:
    """Every job with the tag at one instance, by id.

    Raises:
        LiveError: the pages end or repeat before all jobs that the service counts are listed.
    """
    jobs: dict[str, RemoteJob] = {}
    skip = 0
    for _ in range(_MAX_PAGES):
        answer = client.jobs_get(limit=_PAGE, skip=skip, job_tags=[tag], created_after=since)
        page = read(Listing, answer, "the list of jobs")
        before = len(jobs)
        jobs.update({job.id: job for job in page.jobs})
        skip += len(page.jobs)
        if skip >= page.count:
            return jobs
        if len(jobs) == before:
            break
    raise LiveError(
        f"IBM's service counts {page.count} jobs with one tag but lists {len(jobs)}.",
        "A job may be missing, so nothing was sent or cancelled. Resume later.",
    )
