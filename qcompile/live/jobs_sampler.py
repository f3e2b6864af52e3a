"""A SamplerV2 on the jobs of a run: what live tasks are played on.

Source: qiskit.primitives, BaseSamplerV2 and BasePrimitiveJob, whose interfaces it has.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from qiskit.primitives import BasePrimitiveJob, BaseSamplerV2

from qcompile.errors import LiveError
from qcompile.live.jobs import Jobs
from qcompile.live.pubs import Call


class SamplerJob(BasePrimitiveJob[Any, str]):  # type: ignore[misc]
    """The jobs of one call, which IBM has, or the journal."""

    def __init__(self, jobs: Jobs, call: Call, numbers: list[int]):
        super().__init__(f"{jobs.journal.id}-{numbers[0]}" if numbers else jobs.journal.id)
        self._jobs, self._call, self.numbers = jobs, call, numbers

    def result(self) -> Any:
        """The PrimitiveResult, waited for: a BitArray for each PUB and register.

        Raises:
            LiveError: a job cannot be fetched now, or gave no counts; it can be asked for again.
        """
        parts = [
            self._jobs.bits(number, request)
            for number, request in zip(self.numbers, self._call.requests, strict=True)
        ]
        return self._call.result(parts)

    def job_ids(self) -> list[str]:
        """IBM's names of its jobs, as far as it has them."""
        found = [self._jobs.journal.latest(number) for number in self.numbers]
        return [made.job_id for made in found if made is not None and made.job_id is not None]

    def status(self) -> str:
        """DONE, ERROR or RUNNING, as the journal knows it; `result` asks IBM."""
        found = [self._jobs.journal.latest(number) for number in self.numbers]
        states = {"failed" if made is None else made.state for made in found}
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
            "A job of the guard is not cancelled: what may be charged is fetched.",
            f"IBM's own tools cancel it: {', '.join(self.job_ids()) or 'none is known'}.",
        )


class JobsSampler(BaseSamplerV2):  # type: ignore[misc]
    """A sampler on the jobs of a run, in the order in which they are asked for."""

    def __init__(self, jobs: Jobs):
        self._jobs = jobs

    def run(self, pubs: Iterable[Any], *, shots: int | None = None) -> SamplerJob:
        """The job of PUBs, once IBM or the journal has it. Where it fails, nothing was asked for.

        Raises:
            CountsError, OptionError: what is asked for cannot be run.
            LiveError: a job cannot be sent.
        """
        call, first = Call(pubs, shots), self._jobs.next
        try:
            numbers = [self._jobs.send(request) for request in call.requests]
        except BaseException:
            self._jobs.go_back(first)
            raise
        return SamplerJob(self._jobs, call, numbers)
