"""The task of a `GuardedSampler`, whose jobs its program asks for, and nobody else."""

from __future__ import annotations

from typing import Any, ClassVar

from qcompile.live.journal import TaskKind
from qcompile.live.task import Context, Task


class SamplerTask(Task):
    """The jobs of a `GuardedSampler`. Resumed by name, those that were sent are fetched."""

    kind: ClassVar[TaskKind] = "sampler"
    ends: ClassVar[bool] = False

    def perform(self, context: Context) -> dict[str, Any]:
        """The machine, and how many jobs are done and how many are not."""
        context.jobs.fetch()
        states = context.jobs.journal.states()
        waiting = states.get("sending", 0) + states.get("sent", 0)
        return {"backend": self.backend, "jobs_done": states.get("done", 0), "jobs_open": waiting}
