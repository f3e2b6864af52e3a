"""A calibration of a live backend."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from qcompile.execution import Workload
from qcompile.live.executor import IBMExecutor
from qcompile.live.journal import TaskKind
from qcompile.live.task import Context, Task
from qcompile.mitigation import calibrate, calibration_workload
from qcompile.mitigation.measure import Part


class CalibrateTask(Task):
    """Measure `parts` on `qubits`, `shots` of each circuit, into the file `out`, if any."""

    kind: ClassVar[TaskKind] = "calibrate"

    qubits: tuple[int, ...]
    shots: int
    parts: tuple[Part, ...]
    angles_rad: tuple[float, ...]
    out: str | None

    @property
    def load(self) -> Workload:
        """Its jobs and executions."""
        return calibration_workload(len(self.qubits), self.shots, self.parts, len(self.angles_rad))

    def perform(self, context: Context) -> dict[str, Any]:
        """The calibration as plain values, which is in its file then."""
        calibration = calibrate(
            IBMExecutor(self.device, context.jobs),
            np.array(self.qubits),
            self.shots,
            parts=self.parts,
            angles_rad=np.array(self.angles_rad),
            on_circuit=lambda done, of: context.show(done / of, f"circuit {done} of {of}"),
        )
        first = context.jobs.journal.latest(0)
        if first is not None and first.sent_at is not None:  # and not when it was gone on with
            sent_at = first.sent_at.replace(microsecond=0)
            calibration = calibration.model_copy(update={"created": sent_at})
        if self.out is not None:
            calibration.save(Path(self.out))
        return {"calibration": calibration.model_dump(mode="json"), "file": self.out}
