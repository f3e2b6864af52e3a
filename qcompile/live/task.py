"""What all live tasks have in common: where they run, and what they are given to do it with."""

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
    """The jobs of a run; `say` gets words on how far it is, `note` what a person should read."""

    jobs: Jobs
    say: Callable[[str], None]
    note: Callable[[str], None] = lambda words: None

    def executor(self, device: Device) -> Executor:
        """The executor of the device's machine, by the jobs of the run.

        Raises:
            MissingExtraError: Qiskit is not installed.
        """
        if find_spec("qiskit") is None:
            raise MissingExtraError("A run on real hardware", "ibm")
        from qcompile.live.jobs_sampler import JobsSampler

        return PrimitiveExecutor(device, sampler=JobsSampler(self.jobs), kind="hardware")


class Task(BaseModel):
    """Something to do on a live backend, with all it depends on: its journal holds it.

    `account` and `instance` are names of IBM's own tools; a token is never part of a task.
    `planned_jobs` are those it is expected to take. The jobs of one that never `ends` are
    asked for by a user's program.
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
        """A word for its folder."""
        return self.backend

    def perform(self, context: Context) -> dict[str, Any]:
        """Do it; what it found, as plain values. Asked again, it asks for the same jobs."""
        raise NotImplementedError

    def without_file(self) -> Self:
        """The same task, whose file is not written unless another one is named."""
        return self

    def deliver(self, result: dict[str, Any], out: Path | None) -> dict[str, Any]:
        """What it found, once it is in a file, where the task has one; `out` is another one.

        Raises:
            LiveError: a file is asked for that the task does not have.
        """
        if out is not None:
            raise LiveError(f"A {self.kind} has no file of its own.", "Remove --out.")
        return result


class DeviceTask(Task):
    """One whose circuits are compiled here.

    `device` are the backend's qubits and their calibration when the task began: placement and
    compilation do not change when IBM calibrates anew.
    """

    device: Device
