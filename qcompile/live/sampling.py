"""The task of a `GuardedSampler`, whose jobs only its program requests."""

from __future__ import annotations

from typing import Any, ClassVar

from qcompile.live.journal import TaskKind
from qcompile.live.task import Context, Task


class SamplerTask(Task):
    """The jobs of a `GuardedSampler`. Resuming it fetches the jobs that were sent."""

    kind: ClassVar[TaskKind] = "sampler"
    ends: ClassVar[bool] = False

    def perform(self, context: Context) -> dict[str, Any]:
        """The machine, and the numbers of jobs that are done and open."""
        context.jobs.fetch()
        states = context.jobs.journal.states()
        waiting = states.get("sending", 0) + states.get("sent", 0)
        return {"backend": self.backend, "jobs_done": states.get("done", 0), "jobs_open": waiting}
