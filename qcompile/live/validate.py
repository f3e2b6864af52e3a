"""The live comparison of a twin with its machine."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from qcompile.calibration import Calibration
from qcompile.deploy.twin_check import check_twin
from qcompile.deploy.twin_power import EFFECT, twin_program
from qcompile.execution import Workload
from qcompile.live.journal import TaskKind
from qcompile.live.task import Context, DeviceTask
from qcompile.policy.schema import AnyPolicyFile


class ValidateTask(DeviceTask):
    """Compare the twin of `calibration` with its machine, on observations (B, features).

    The power refers to a p01 that is raised by `effect`.
    """

    kind: ClassVar[TaskKind] = "validate"

    calibration: Calibration
    calibration_file: str
    policy: AnyPolicyFile
    observations: list[list[float]]
    shots: int
    effect: float = EFFECT

    @property
    def load(self) -> Workload:
        """Its number of jobs and executions."""
        _, executable = twin_program(self.calibration, self.policy.policy())
        return Workload.of_batch(len(self.observations), executable.round_count, self.shots)

    def perform(self, context: Context) -> dict[str, Any]:
        """The verdict as plain values."""
        check = check_twin(
            self.calibration,
            self.policy.policy(),
            np.array(self.observations),
            context.executor(self.device),
            self.shots,
            self.effect,
        )
        return {"file": self.calibration_file, "shots": self.shots, **check.values()}
