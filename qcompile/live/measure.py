"""A calibration of a live backend."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from qcompile.calibration import Calibration, load_calibration
from qcompile.errors import CalibrationError
from qcompile.execution import Workload
from qcompile.live.journal import TaskKind
from qcompile.live.task import Context, DeviceTask
from qcompile.mitigation import calibrate, calibration_workload
from qcompile.mitigation.measure import Part


class CalibrateTask(DeviceTask):
    """Measure `parts` on `qubits`, `shots` of each circuit, into the file `out`, if any.

    `angles_rad` has the angle of each circuit and qubit; of each circuit alone in journals from
    before qubits had orders of their own, which end as they began. A file that is there is
    overwritten with `force` alone; without, another name is taken.
    """

    kind: ClassVar[TaskKind] = "calibrate"

    qubits: tuple[int, ...]
    shots: int
    parts: tuple[Part, ...]
    angles_rad: tuple[float, ...] | tuple[tuple[float, ...], ...]
    out: str | None
    force: bool = False

    @property
    def load(self) -> Workload:
        """Its jobs and executions."""
        return calibration_workload(len(self.qubits), self.shots, self.parts, len(self.angles_rad))

    def perform(self, context: Context) -> dict[str, Any]:
        """The calibration as plain values."""
        angles = np.array(self.angles_rad)
        if angles.ndim == 1:
            angles = np.repeat(angles[:, None], len(self.qubits), axis=1)
        calibration = calibrate(
            context.executor(self.device),
            np.array(self.qubits),
            self.shots,
            parts=self.parts,
            angles_rad=angles,
            on_circuit=lambda done, of: context.say(f"circuit {done} of {of}"),
        )
        first = context.jobs.journal.latest(0)
        if first is not None and first.sent_at is not None:  # and not when it was resumed
            sent_at = first.sent_at.replace(microsecond=0)
            calibration = calibration.model_copy(update={"created": sent_at})
        return {"calibration": calibration.model_dump(mode="json")}

    def without_file(self) -> CalibrateTask:
        """The same task, whose file is not written unless another one is named."""
        return self.model_copy(update={"out": None})

    def deliver(self, result: dict[str, Any], out: Path | None) -> dict[str, Any]:
        """The calibration, once it is in its file: `out`, or that of the task.

        Of what is there already only the task's own file is overwritten, and that with `force`.

        Raises:
            OutputError: the file cannot be written; the journal keeps the calibration.
        """
        path = out or (None if self.out is None else Path(self.out))
        if path is None:
            return result | {"file": None}
        calibration = Calibration.model_validate(result["calibration"])
        force = self.force and out is None
        if path.exists() and not force and not _holds(path, calibration):
            path = path.with_stem(f"{path.stem}-{result['run']}")
        if not _holds(path, calibration):
            calibration.save(path)
        return result | {"file": str(path)}


def _holds(path: Path, calibration: Calibration) -> bool:
    try:
        return load_calibration(path) == calibration
    except CalibrationError:
        return False
