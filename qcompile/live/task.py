"""The base of all live tasks, and the context they run in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Field

from qcompile.device import Device
from qcompile.errors import LiveError, MissingExtraError
from qcompile.execution import Executor, PrimitiveExecutor
from qcompile.live.jobs import Jobs
from qcompile.live.journal import TaskKind


@dataclass(frozen=True)
class Context:
    """The jobs of a run; `say` gets progress messages, `note` messages for a person."""

    jobs: Jobs
    say: Callable[[str], None]
    note: Callable[[str], None] = lambda words: None

    def executor(self, device: Device) -> Executor:
        """An executor on the device's machine, backed by the jobs of the run.

        Raises:
            MissingExtraError: Qiskit is not installed.
        """
        if find_spec("qiskit") is None:
            raise MissingExtraError("A run on real hardware", "ibm")
        from qcompile.live.jobs_sampler import JobsSampler

        return PrimitiveExecutor(device, sampler=JobsSampler(self.jobs), kind="hardware")


class Task(BaseModel):
    """A task on a live backend with everything it depends on; its journal stores it.

    `account` and `instance` are names saved by IBM's tools; a token is never part of a task.
    `planned_jobs` is the expected number of jobs. If `ends` is False, a user's program requests the
    jobs.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: ClassVar[TaskKind]
    ends: ClassVar[bool] = True

    backend: str
    account: str | None = None
    instance: str | None = None
    batch: bool = False
    jobs_per_minute: Annotated[int, Field(ge=1)] | None = None
    planned_jobs: int = 1

    @property
    def name(self) -> str:
        """A word for the name of its folder."""
        return self.backend

    def perform(self, context: Context) -> dict[str, Any]:
        """Perform the task; return its result as plain values. A repeat requests the same jobs."""
        raise NotImplementedError

    def without_file(self) -> Self:
        """The same task without its file, so that nothing is written unless `--out` names one."""
        return self

    def deliver(self, result: dict[str, Any], out: Path | None) -> dict[str, Any]:
        """The result, once it is in the task's file, if it has one; `out` names a different file.

        Raises:
            LiveError: `out` is given and the task writes no file.
        """
        if out is not None:
            raise LiveError(f"A {self.kind} writes no file.", "Remove --out.")
        return result


class DeviceTask(Task):
    """A task whose circuits are compiled here.

    `device` has the backend's qubits and their calibration when the task began: placement and
    compilation do not change when IBM recalibrates.
    """

    device: Device
