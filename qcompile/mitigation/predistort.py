"""Predistortion: angles changed when they are bound, so that the device shows the ideal `<Z>`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from qcompile.arrays import BoolArray, FloatArray
from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.mitigation.undo import Mitigation, response_mitigation
from qcompile.passes import Executable


@dataclass(frozen=True, eq=False)
class Predistortion:
    """Maps an angle to the one at which the device shows the ideal `<Z>` of the first."""

    response: Mitigation
    offset_rad: float
    has_rotation: BoolArray

    def __call__(self, angles: FloatArray) -> FloatArray:
        polar = angles - self.offset_rad
        wanted = (np.cos(polar) - self.response.offset) / self.response.contrast
        turn = np.arccos(np.clip(wanted, -1.0, 1.0))
        side = np.where(np.sin(polar) < 0.0, -1.0, 1.0)
        predistorted = self.offset_rad + self.response.tilt + side * turn
        return np.where(self.has_rotation, predistorted, angles)


def predistorted(executable: Executable, calibration: Calibration) -> Executable:
    """An executable whose measured `<Z>` is the ideal one, where the device can reach it.

    It can reach [offset - contrast, offset + contrast] of the qubit's response curve; values beyond
    are clipped. Unlike mitigation after the measurement, this amplifies no shot noise.

    Raises:
        CalibrationError: the executable is not of level 2, or the response of a qubit is not
            calibrated.
    """
    if executable.predistort is not None:
        raise CalibrationError(
            "The executable is already predistorted.", "Start from the compiled one."
        )
    executable.source.require_narrow("Predistortion")
    response = response_mitigation(calibration, executable, any_side=True)
    circuits = executable.native.circuits
    has_rotation = np.array([bool(circuit.angles) for circuit in circuits], dtype=np.bool_)
    offset_rad = executable.device.native.angle_offset_rad
    return replace(executable, predistort=Predistortion(response, offset_rad, has_rotation))
