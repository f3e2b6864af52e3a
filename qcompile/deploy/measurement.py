"""From inputs to the `<Z>` that a device shows: compiled once, run, mitigated."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.execution import (
    Executor,
    Workload,
    check_shots,
    exact,
    expectation_from_ones,
)
from qcompile.ir import Program
from qcompile.mitigation import (
    CALIBRATION_SHOTS,
    Misfit,
    Mitigation,
    calibrate,
    calibration_workload,
    check_response_level,
    misfits,
    predistorted,
    readout_mitigation,
    response_mitigation,
)
from qcompile.mitigation.measure import Part
from qcompile.passes import Executable, compile

MITIGATIONS = ("none", "readout", "response")


class Measurement:
    """A program compiled for an executor's device, with its mitigation.

    `shots` None takes expectations without shot noise. `calibration` is measured first where it is
    needed and not given. With `predistort` the angles are changed by the response curves instead
    of undoing them afterwards. `importance` (circuits,) guides the placement. With `copies` so many
    rows of a batch are run side by side, by one execution. `misfits` are the fits it stands on that
    contradict their own counts.

    Raises:
        CalibrationError: `mitigation` is not one of MITIGATIONS or contradicts `predistort`, the
            calibration is of another device, or a qubit cannot be calibrated.
        CircuitError: importance or copies are out of range.
        CountsError: shots out of range.
    """

    def __init__(
        self,
        program: Program,
        executor: Executor,
        *,
        shots: int | None,
        level: int = 2,
        mitigation: str = "none",
        calibration: Calibration | None = None,
        predistort: bool = False,
        importance: FloatArray | None = None,
        copies: int = 1,
    ):
        if shots is not None:
            check_shots(shots)
        if mitigation not in MITIGATIONS:
            raise CalibrationError(
                f"Unknown mitigation {mitigation!r}.", f"Known: {', '.join(MITIGATIONS)}."
            )
        if predistort and mitigation != "none":
            raise CalibrationError(
                f"Predistorted angles and mitigation {mitigation!r} contradict each other.",
                "Bent angles make the device show the ideal <Z>: take --mitigation none.",
            )
        if predistort or mitigation == "response":
            check_response_level(level, predistort=predistort)  # before anything is measured
        self.shots, self.copies, self.executor = shots, copies, executor
        self.executable: Executable = compile(
            program, executor.device, level, importance, copies=copies
        )
        self.calibration_load = Workload()
        self.misfits: list[Misfit] = []
        self._mitigation: Mitigation | None = None
        if mitigation == "readout":
            measured = self._calibrated(calibration, "readout")
            self._mitigation = readout_mitigation(measured, self.executable)
        elif mitigation == "response":
            measured = self._calibrated(calibration, "response")
            self._mitigation = response_mitigation(measured, self.executable)
        elif predistort:
            measured = self._calibrated(calibration, "response")
            self.executable = predistorted(self.executable, measured)
        if executor.calibration is not None:
            self._look_at(executor.calibration, "response")
        self._prepared = executor.prepare(self.executable)

    def _look_at(self, calibration: Calibration, part: Part) -> None:
        """Note the misfits of a part on the qubits of the executable, each once."""
        found = misfits(calibration, [part], self.executable.qubits.tolist())
        self.misfits += [one for one in found if one not in self.misfits]

    def _calibrated(self, given: Calibration | None, part: Part) -> Calibration:
        """The calibration given, that of the twin, or one that is measured now; looked at."""
        calibration = self._calibration(given, part)
        self._look_at(calibration, part)
        return calibration

    def _calibration(self, given: Calibration | None, part: Part) -> Calibration:
        given = self.executor.calibration if given is None else given
        if given is None:
            shots = None if self.shots is None else CALIBRATION_SHOTS
            measured = calibrate(self.executor, self.executable.qubits, shots, parts=[part])
            if shots is not None:
                self.calibration_load = calibration_workload(len(measured.qubits), shots, [part])
            if measured.unfitted:
                raise CalibrationError(
                    f"The {part} of {self.executor.device.name} cannot be calibrated.",
                    *measured.unfitted,
                )
            return measured
        name = self.executor.device.name
        if given.backend != name:
            raise CalibrationError(
                f"The calibration is of {given.backend}, the backend is {name}.",
                f"Measure one with `qcompile calibrate --backend {name}`.",
            )
        return given

    def __call__(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        """Inputs (B, inputs) and theta (parameters,) to `<Z>` as measured, (B, circuits)."""
        rows, copies = len(x), self.copies
        if copies > 1:  # side by side; the last row is filled up with zeros
            x = np.pad(x, ((0, -rows % copies), (0, 0)))
            x = x.reshape(len(x) // copies, copies * x.shape[1])
        if self.shots is None:
            z = exact(self._prepared).expectation(x, theta)
        else:
            ones = self._prepared.ones(x, theta, self.shots)
            z = expectation_from_ones(ones, self.shots)
        if self._mitigation is not None:
            z = self._mitigation.apply(z)
        return z.reshape(len(z) * copies, z.shape[1] // copies)[:rows]
