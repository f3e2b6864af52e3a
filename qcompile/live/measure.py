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
    """Measure `parts` of a calibration on `qubits`, `shots` per circuit, into the file `out`.

    `angles_rad` holds the angle of each circuit and qubit, or in earlier journals of each circuit.
    An existing file is overwritten only with `force`; otherwise another name is chosen.
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
        """Its number of jobs and executions."""
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
        if first is not None and first.sent_at is not None:  # not the time of resuming
            sent_at = first.sent_at.replace(microsecond=0)
            calibration = calibration.model_copy(update={"created": sent_at})
        return {"calibration": calibration.model_dump(mode="json")}

    def without_file(self) -> CalibrateTask:
        """The same task without its file, so that nothing is written unless `--out` names one."""
        return self.model_copy(update={"out": None})

    def deliver(self, result: dict[str, Any], out: Path | None) -> dict[str, Any]:
        """The result, once the calibration is written to `out` or to the task's file.

        Of existing files only the task's own is overwritten, and only with `force`.

        Raises:
            OutputError: the file cannot be written; the calibration stays in the journal.
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
