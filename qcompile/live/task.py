"""What all live tasks have in common: where they run, and what they are given to do it with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict

from qcompile.device import Device
from qcompile.live.jobs import Jobs
from qcompile.live.journal import TaskKind


@dataclass(frozen=True)
class Context:
    """The jobs of a run, and `show`, which gets how much is done, and words."""

    jobs: Jobs
    show: Callable[[float, str], None]


class Task(BaseModel):
    """Something to do on a live backend, with all it depends on: its journal holds it.

    `device` are the backend's qubits and their calibration when the task began: placement and
    compilation do not change when IBM calibrates anew. `account` and `instance` are names of IBM's
    own tools; a token is never part of a task.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: ClassVar[TaskKind]

    backend: str
    device: Device
    account: str | None = None
    instance: str | None = None
    batch: bool = False

    @property
    def name(self) -> str:
        """A word for its folder."""
        return self.backend

    @property
    def total(self) -> float:
        """What `Context.show` counts to."""
        return 1.0

    def perform(self, context: Context) -> dict[str, Any]:
        """Do it; what it found, as plain values. Asked again, it asks for the same jobs."""
        raise NotImplementedError
