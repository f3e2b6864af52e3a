"""The service behind the routes: machines, jobs and batches, and the rules of the Open Plan."""

from __future__ import annotations

import json
import math
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import dateutil.parser

from .answers import LIST, RESULTS, SUBMIT
from .backends import Machine
from .errors import ApiError
from .faults import OF_JOBS, OF_LISTS, Fault, Faults
from .identity import CRN
from .jobs import CANCELLED, COMPLETED, MAX_EXECUTIONS, QUEUED, Batch, Entry, Job, usage_seconds
from .physics import RefusedError, draw
from .programs import read_work
from .settings import Settings

_LONGEST_PAGE = 200


class Service:
    """All state of the stand-in. Methods are safe to call from many threads at once."""

    def __init__(self, machines: Mapping[str, Machine], settings: Settings, faults: Faults):
        self._machines = machines
        self._settings = settings
        self._faults = faults
        self._jobs: dict[str, Job] = {}
        self._batches: dict[str, Batch] = {}
        self._accepted: deque[float] = deque()
        self._lock = threading.RLock()

    def backends(self) -> dict[str, Any]:
        known = [m for m in self._machines.values() if m.name not in self._faults.retired]
        if len(known) < len(self._machines):
            self._faults.record("retired")
        return {"devices": [machine.entry(self._waiting(machine.name)) for machine in known]}

    def machine(self, name: str) -> Machine:
        """The machine of that name.

        Raises:
            ApiError: 404, there is none, or it is retired.
        """
        if name in self._faults.retired and name in self._machines:
            self._faults.record("retired")
        elif name in self._machines:
            return self._machines[name]
        raise ApiError(404, 1231, f"The backend {name} was not found.")

    def status(self, name: str) -> dict[str, Any]:
        return self.machine(name).status(self._waiting(name))

    def usage(self) -> dict[str, Any]:
        """The used and remaining time of the instance, as returned by GET /instances/usage."""
        consumed = self._consumed(time.time())
        return {
            "instance_id": CRN,
            "plan_id": "open",
            "usage_consumed_seconds": consumed,
            "usage_limit_seconds": self._settings.usage_limit_seconds,
            "usage_allocation_seconds": self._settings.usage_limit_seconds,
            "usage_limit_reached": consumed >= self._settings.usage_limit_seconds,
        }

    def submit(self, body: Mapping[str, Any]) -> Job:
        """Accept a job.

        Raises:
            ApiError: the job is refused; nothing of it is kept.
        """
        machine = self.machine(str(body.get("backend")))
        try:
            work = read_work(str(body.get("program_id")), body.get("params") or {}, machine)
        except RefusedError as error:
            raise ApiError(400, 1517, str(error)) from error
        if work.executions > MAX_EXECUTIONS:
            raise ApiError(
                400,
                8058,
                f"The job has {work.executions} executions; the limit is {MAX_EXECUTIONS}.",
            )
        with self._lock:
            now = time.time()
            session_id = body.get("session_id")
            if session_id is not None and not self._batch(session_id).takes_jobs(now):
                raise ApiError(400, 1211, f"The session {session_id} is closed.")
            self._check_rate(now)
            usage = usage_seconds(work.executions, self._settings.usage_factor)
            starts = now + self._settings.queue_seconds
            if self._consumed(now) >= self._settings.usage_limit_seconds:
                starts = math.inf
            fault = self._faults.strike(OF_JOBS, SUBMIT)
            if fault is Fault.JOB_WAITS:
                starts += self._faults.wait_seconds
            job = Job(
                program_id=body["program_id"],
                backend=machine.name,
                tags=list(body.get("tags") or []),
                session_id=session_id,
                cost=body.get("cost"),
                params=body["params"],
                work=work,
                usage=usage,
                charged=usage,
                created=now,
                starts=starts,
                ends=starts + self._settings.run_seconds,
            )
            job.limit()
            if fault in (Fault.JOB_FAILS, Fault.JOB_FAILS_CHARGED):
                job.fail(charged=fault is Fault.JOB_FAILS_CHARGED, suffix=self._faults.suffix)
            elif fault is Fault.JOB_CANCELLED:
                job.outcome, job.charged, job.ends = CANCELLED, 0.0, job.starts
                job.reason, job.reason_code = "Job was cancelled by another user.", None
            if fault is not None:
                self._faults.record(fault)
            self._jobs[job.id] = job
        return job

    def _check_rate(self, now: float) -> None:
        """Take one more job of this minute.

        Raises:
            ApiError: 429, the minute's limit is reached.
        """
        most, minute_seconds = self._settings.jobs_per_minute, self._settings.minute_seconds
        while self._accepted and self._accepted[0] <= now - minute_seconds:
            self._accepted.popleft()
        if most and len(self._accepted) >= most:
            self._faults.record("too_many_jobs")
            again = self._accepted[len(self._accepted) - int(most)] + minute_seconds
            raise ApiError(429, 429, "Too many jobs in a minute.", again - now)
        self._accepted.append(now)

    def job(self, job_id: str) -> Job:
        with self._lock:
            job = self._jobs.get(job_id)
        if job is None or job.deleted:
            raise ApiError(404, 1291, f"Job not found. Job ID: {job_id}")
        return job

    def describe(self, job: Job, *, with_params: bool) -> dict[str, Any]:
        return job.answer(time.time(), with_params=with_params)

    def metrics(self, job: Job) -> dict[str, Any]:
        return job.metrics(time.time(), self._settings.usage_lag_seconds)

    def logs(self, job: Job) -> str | None:
        """The output of the job; None until it has ended."""
        now = time.time()
        return f"{job.id}: {job.status(now)}\n" if job.has_ended(now) else None

    def results(self, job: Job) -> str | None:
        """The body of the results, spoiled if a fault strikes; None while there are none.

        If the job ended without results, it is the reason as text.
        """
        now = time.time()
        if job.status(now) != COMPLETED:
            if self._faults.strike((Fault.REASON_MISSING,), RESULTS):
                self._faults.record(Fault.REASON_MISSING)
                raise ApiError(404, 1292, f"The results of job {job.id} were not found.")
            return job.reason if job.has_ended(now) else None
        with job.lock:
            if job.body is None:
                device = self._machines[job.backend].device
                job.body = job.work.encode(draw(job.work.items, device, self._settings.seed))
            if job.spoiled_fetches == 0:
                first = job.results_fetched == 0
                job.spoiled, job.spoiled_fetches = self._faults.strike_results(first)
            job.results_fetched += 1
            if job.spoiled is None:
                return job.body
            self._faults.record(job.spoiled)
            job.spoiled_fetches -= 1
            return _spoil(job.body, job.spoiled)

    def jobs(self, query: Mapping[str, Any], tags: Sequence[str]) -> dict[str, Any]:
        """A page of jobs, the newest first, and the count of all that the filters let through."""
        now = time.time()
        known_before = now - self._faults.listing_lag_seconds
        with self._lock:
            everything = [job for job in self._jobs.values() if not job.deleted]
        hidden = [job for job in everything if job.created > known_before]
        if hidden and self._faults.listing_lag_seconds:
            self._faults.record("listing_lag")
            everything = [job for job in everything if job.created <= known_before]
        fault = self._faults.strike(OF_LISTS, LIST)
        if fault is not None:
            self._faults.record(fault)
            tags = ()
        found = [job for job in everything if _matches(job, query, tags, now)]
        found.sort(key=lambda job: job.created, reverse=query.get("sort") != "ASC")
        offset, limit = int(query.get("offset", 0)), int(query.get("limit", 10))
        page = found[offset : offset + min(limit, _LONGEST_PAGE)]
        rows = [job.answer(now) for job in page]
        return {
            "jobs": [_without_tags(row) if fault is Fault.TAGS_HIDDEN else row for row in rows],
            "count": len(found),
            "limit": limit,
            "offset": offset,
        }

    def cancel(self, job: Job) -> None:
        with self._lock:
            if not job.cancel(time.time(), "Job was cancelled by the user."):
                raise ApiError(409, 1293, f"Job {job.id} has ended and cannot be cancelled.")

    def delete(self, job: Job) -> None:
        with self._lock:
            if not job.has_ended(time.time()):
                raise ApiError(409, 1294, f"Job {job.id} has not ended and cannot be deleted.")
            job.deleted = True

    def open_batch(self, body: Mapping[str, Any]) -> dict[str, Any]:
        """Open a batch.

        Raises:
            ApiError: 403, the mode is another: the Open Plan has no sessions.
        """
        if body.get("mode") != "batch":
            raise ApiError(
                403, 1352, "You are not authorized to run a session when using the open plan."
            )
        machine = self.machine(str(body.get("backend")))
        longest = self._settings.batch_seconds
        batch = Batch(machine.name, time.time(), min(body.get("max_ttl") or longest, longest))
        with self._lock:
            self._batches[batch.id] = batch
        return self.batch(batch.id)

    def batch(self, batch_id: str) -> dict[str, Any]:
        with self._lock:
            return self._batch(batch_id).answer(self._jobs.values(), time.time())

    def close_batch(self, batch_id: str, *, cancel_jobs: bool = False) -> None:
        """Close the batch for new jobs, and cancel waiting ones if asked to."""
        with self._lock:
            now = time.time()
            batch = self._batch(batch_id)
            batch.closed = now if batch.closed is None else batch.closed
            for job in self._jobs.values():
                if cancel_jobs and job.session_id == batch_id and job.status(now) == QUEUED:
                    job.cancel(now, "The session of the job was cancelled.")

    def entries(self) -> list[Entry]:
        """Every job ever accepted, the oldest first."""
        with self._lock:
            now = time.time()
            return [job.entry(now) for job in self._jobs.values()]

    def _batch(self, batch_id: str) -> Batch:
        if batch_id not in self._batches:
            raise ApiError(404, 1212, f"Session not found. Session ID: {batch_id}")
        return self._batches[batch_id]

    def _waiting(self, backend: str) -> int:
        now = time.time()
        with self._lock:
            return sum(
                j.backend == backend and j.status(now) == QUEUED for j in self._jobs.values()
            )

    def _consumed(self, now: float) -> float:
        with self._lock:
            return math.fsum(job.charged_by(now) for job in self._jobs.values())


def _matches(job: Job, query: Mapping[str, Any], tags: Sequence[str], now: float) -> bool:
    exact = {"backend": job.backend, "program": job.program_id, "session_id": job.session_id}
    if any(key in query and query[key] != value for key, value in exact.items()):
        return False
    if "pending" in query and (query["pending"] == "true") == job.has_ended(now):
        return False
    if "created_after" in query and job.created < _seconds(query["created_after"]):
        return False
    if "created_before" in query and job.created > _seconds(query["created_before"]):
        return False
    return set(tags) <= set(job.tags)


def _without_tags(row: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in row.items() if key != "tags"}


def _seconds(time_: str) -> float:
    return float(dateutil.parser.isoparse(time_).timestamp())


def _spoil(body: str, kind: Fault) -> str:
    if kind is Fault.RESULTS_TRUNCATED:
        return body[: len(body) // 2]
    return "" if kind is Fault.RESULTS_EMPTY else json.dumps({"data": [], "metadata": []})
