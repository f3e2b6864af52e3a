"""A SamplerV2 backed by the jobs of a run; live tasks use it.

Implements BaseSamplerV2 and BasePrimitiveJob of qiskit.primitives.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from qiskit.primitives import BasePrimitiveJob, BaseSamplerV2

from qcompile.errors import LiveError
from qcompile.live.jobs import Jobs
from qcompile.live.pubs import Call


class SamplerJob(BasePrimitiveJob[Any, str]):  # type: ignore[misc]
    """The jobs of one call, held by IBM or recorded in the journal."""

    def __init__(self, jobs: Jobs, call: Call, numbers: list[int]):
        super().__init__(f"{jobs.journal.id}-{numbers[0]}" if numbers else jobs.journal.id)
        self._jobs, self._call, self.numbers = jobs, call, numbers

    def result(self) -> Any:
        """The PrimitiveResult, once it is there: a BitArray for each PUB and register.

        Raises:
            LiveError: a job cannot be fetched now, or returned no counts; call `result` again
                later.
        """
        parts = [
            self._jobs.bits(number, request)
            for number, request in zip(self.numbers, self._call.requests, strict=True)
        ]
        return self._call.result(parts)

    def job_ids(self) -> list[str]:
        """The ids of its jobs at IBM, as far as they are known."""
        latest = [self._jobs.journal.latest(number) for number in self.numbers]
        return [last.job_id for last in latest if last is not None and last.job_id is not None]

    def status(self) -> str:
        """DONE, ERROR or RUNNING according to the journal; `result` asks IBM."""
        latest = [self._jobs.journal.latest(number) for number in self.numbers]
        states = {"failed" if last is None else last.state for last in latest}
        if states <= {"done"}:
            return "DONE"
        return "ERROR" if "failed" in states else "RUNNING"

    def done(self) -> bool:
        return self.status() == "DONE"

    def running(self) -> bool:
        return self.status() == "RUNNING"

    def cancelled(self) -> bool:
        return False

    def in_final_state(self) -> bool:
        return not self.running()

    def cancel(self) -> None:
        """Refused: a job that may have begun is charged, and its counts would be lost.

        Raises:
            LiveError: always.
        """
        raise LiveError(
            "A guarded job cannot be cancelled: it may be charged, so its counts are fetched.",
            f"IBM's own tools can cancel it: {', '.join(self.job_ids()) or 'its ID is not known'}.",
        )


class JobsSampler(BaseSamplerV2):  # type: ignore[misc]
    """A sampler backed by the jobs of a run, in the order they are requested."""

    def __init__(self, jobs: Jobs):
        self._jobs = jobs

    def run(self, pubs: Iterable[Any], *, shots: int | None = None) -> SamplerJob:
        """The job for these PUBs, once IBM or the journal has it; on failure nothing was requested.

        Raises:
            CountsError, OptionError: the PUBs cannot be run.
            LiveError: a job cannot be sent.
        """
        call, first = Call(pubs, shots), self._jobs.next
        try:
            numbers = [self._jobs.send(request) for request in call.requests]
        except BaseException:
            self._jobs.go_back(first)
            raise
        return SamplerJob(self._jobs, call, numbers)
