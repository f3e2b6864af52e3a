"""Angles bent when they are bound, so that the device's own curve gives the ideal `<Z>`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.mitigation.undo import Mitigation, response_mitigation
from qcompile.passes import Executable


@dataclass(frozen=True, eq=False)
class _Bend:
    """From the angle whose ideal answer is wanted to the angle at which the device gives it."""

    response: Mitigation
    offset_rad: float
    has_rotation: NDArray[np.bool_]

    def __call__(self, angles: FloatArray) -> FloatArray:
        polar = angles - self.offset_rad
        wanted = (np.cos(polar) - self.response.offset) / self.response.contrast
        turn = np.arccos(np.clip(wanted, -1.0, 1.0))
        side = np.where(np.sin(polar) < 0.0, -1.0, 1.0)
        bent = self.offset_rad + self.response.tilt + side * turn
        return np.where(self.has_rotation, bent, angles)


def predistorted(executable: Executable, calibration: Calibration) -> Executable:
    """The executable with bent angles: the measured `<Z>` is the ideal one, where it is reachable.

    Reachable is [offset - contrast, offset + contrast] of the qubit's response curve; beyond it the
    nearest is taken. No shot noise is amplified, as mitigation afterwards would do.

    Raises:
        CalibrationError: the executable is not of level 2, or a qubit's response is not calibrated.
    """
    if executable.bend is not None:
        raise CalibrationError("The executable is bent already.", "Start from the compiled one.")
    response = response_mitigation(calibration, executable, any_side=True)
    has_rotation = np.array([count["rz"] + count["rx"] for count in executable.gate_counts()]) > 0
    return replace(executable, bend=_Bend(response, executable.angle_offset_rad, has_rotation))
