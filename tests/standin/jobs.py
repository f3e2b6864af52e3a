"""Jobs: their timeline, their cost, and the ledger of all accepted jobs."""

from __future__ import annotations

import math
import threading
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from pydantic import BaseModel, ConfigDict

from .faults import Fault
from .programs import Work

OVERHEAD_SECONDS = 2.0
EXECUTION_SECONDS = 0.00035
"""IBM's quick estimate of usage: 2 s for a job and 0.35 ms for an execution."""
MAX_EXECUTIONS = 10_000_000
"""Of one job, over all of its PUBs."""
RAN_TOO_LONG = 1305

QUEUED, RUNNING = "Queued", "Running"
COMPLETED, FAILED, CANCELLED = "Completed", "Failed", "Cancelled"


def usage_seconds(executions: int, factor: float = 1.0) -> float:
    """The charge of a completed job."""
    return round((OVERHEAD_SECONDS + EXECUTION_SECONDS * executions) * factor, 6)


def iso(seconds: float) -> str:
    """Seconds since the epoch in the service's time format, in UTC."""
    return datetime.fromtimestamp(seconds, UTC).isoformat().replace("+00:00", "Z")


class Entry(BaseModel):
    """One job of the ledger. `charged_seconds` is 0 until the job has ended."""

    model_config = ConfigDict(frozen=True)

    id: str
    tags: list[str]
    program_id: str
    backend: str
    session_id: str | None
    status: str
    circuits: int
    shots: int
    executions: int
    charged_seconds: float
    created: str
    results_fetched: int
    deleted: bool


class Ledger(BaseModel):
    """Every job ever accepted, the requests by method and route, and the faults that happened."""

    model_config = ConfigDict(frozen=True)

    jobs: list[Entry]
    requests: dict[str, int]
    faults: dict[str, int]

    @property
    def charged_seconds(self) -> float:
        return sum(job.charged_seconds for job in self.jobs)


@dataclass
class Job:
    """A job and the times of its life, in seconds since the epoch.

    It waits until `starts`, runs until `ends`, and has its `outcome` from then on.
    """

    program_id: str
    backend: str
    tags: list[str]
    session_id: str | None
    cost: float | None
    params: Mapping[str, Any]
    work: Work
    usage: float
    created: float
    starts: float
    ends: float
    outcome: str = COMPLETED
    reason: str | None = None
    reason_code: int | None = None
    charged: float = 0.0
    id: str = field(default_factory=lambda: uuid.uuid4().hex[:20])
    body: str | None = None
    results_fetched: int = 0
    spoiled: Fault | None = None
    spoiled_fetches: int = 0
    deleted: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def status(self, now: float) -> str:
        if now < self.starts:
            return QUEUED
        return RUNNING if now < self.ends else self.outcome

    def has_ended(self, now: float) -> bool:
        return now >= self.ends

    def charged_by(self, now: float) -> float:
        return self.charged if self.has_ended(now) else 0.0

    def fail(self, *, charged: bool = False, suffix: str = "") -> None:
        """Let the job end by an error of the system, free of charge unless `charged`."""
        self.outcome, self.charged = FAILED, self.charged if charged else 0.0
        self.reason = " ".join(filter(None, ("Internal error of the system.", suffix)))
        self.reason_code = 9999

    def cancel(self, now: float, reason: str) -> bool:
        """Cancel the job and charge the time it used; False if it had already ended."""
        if self.has_ended(now):
            return False
        if now < self.starts:
            self.charged = 0.0
        else:
            share = (now - self.starts) / (self.ends - self.starts)
            self.charged = round(self.usage * share, 6)
        self.starts, self.ends = min(self.starts, now), now
        self.outcome, self.reason, self.reason_code = CANCELLED, reason, None
        return True

    def limit(self) -> None:
        """Enforce the job's cap: if it would exceed it, cancel the job and charge the cap."""
        if self.cost is not None and self.usage > self.cost:
            self.outcome, self.charged, self.reason_code = CANCELLED, self.cost, RAN_TOO_LONG
            self.reason = f"Job ran longer than its maximum execution time of {self.cost} s."

    def answer(self, now: float, *, with_params: bool = False) -> dict[str, Any]:
        """The job as returned by GET /jobs/{id}."""
        ended = self.has_ended(now)
        state: dict[str, Any] = {"status": self.status(now)}
        if ended and self.reason:
            state["reason"] = self.reason
            if self.reason_code:
                state["reason_code"] = self.reason_code
        answer: dict[str, Any] = {
            "id": self.id,
            "backend": self.backend,
            "state": state,
            "status": state["status"],
            "program": {"id": self.program_id},
            "created": iso(self.created),
            "tags": self.tags,
            "cost": self.cost,
            "private": False,
            "estimated_running_time_seconds": self.usage,
        }
        if self.session_id is not None:
            answer["session_id"] = self.session_id
        if ended:
            answer["ended"] = iso(self.ends)
        if with_params:
            answer["params"] = self.params
        return answer

    def metrics(self, now: float, usage_lag_seconds: float) -> dict[str, Any]:
        """The usage and times of the job, as returned by GET /jobs/{id}/metrics."""
        ran = self.starts < self.ends
        final = now >= self.ends + usage_lag_seconds
        return {
            "timestamps": {
                "created": iso(self.created),
                "running": iso(self.starts) if ran and now >= self.starts else None,
                "finished": iso(self.ends) if self.has_ended(now) else None,
            },
            "usage": {
                "qpu_charge_time_seconds": self.charged if final else 0,
                "status": "complete" if final else "pending",
            },
            "executions": self.work.executions,
            "num_circuits": self.work.circuits,
            "num_qubits": [item.plan.qubits for item in self.work.items],
        }

    def entry(self, now: float) -> Entry:
        return Entry(
            id=self.id,
            tags=list(self.tags),
            program_id=self.program_id,
            backend=self.backend,
            session_id=self.session_id,
            status=self.status(now),
            circuits=self.work.circuits,
            shots=self.work.shots,
            executions=self.work.executions,
            charged_seconds=self.charged_by(now),
            created=iso(self.created),
            results_fetched=self.results_fetched,
            deleted=self.deleted,
        )


@dataclass
class Batch:
    """A batch of jobs; it accepts none once it is closed or its time is over."""

    backend: str
    created: float
    max_ttl: float
    id: str = field(default_factory=lambda: str(uuid.uuid4()))
    closed: float | None = None

    def takes_jobs(self, now: float) -> bool:
        return self.closed is None and now < self.created + self.max_ttl

    def answer(self, jobs: Iterable[Job], now: float) -> dict[str, Any]:
        """The batch as returned by GET /sessions/{id}."""
        own = [job for job in jobs if job.session_id == self.id]
        busy = any(not job.has_ended(now) for job in own)
        open_ = self.takes_jobs(now)
        return {
            "id": self.id,
            "backend_name": self.backend,
            "mode": "batch",
            "state": ("active" if busy else "open" if not own else "inactive")
            if open_
            else "closed",
            "accepting_jobs": open_,
            "created_at": iso(self.created),
            "closed_at": iso(self.closed) if self.closed is not None else None,
            "max_ttl": int(self.max_ttl),
            "active_ttl": int(self.max_ttl),
            "interactive_ttl": 60,
            "elapsed_time": math.fsum(job.charged_by(now) for job in own),
            "timestamps": [],
        }
