"""Response curves as functions of the ideal polar angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.calibration import ResponseFit
from qcompile.native import NativeGates


@dataclass(frozen=True, eq=False)
class PolarCurves:
    """Measured `<Z>` = offset + contrast cos(w - tilt) of each qubit, w the ideal polar angle.

    Arrays of (qubits,), tilts in [-pi/2, pi/2] radians: contrast is negative where 0 and 1 are
    swapped. `covariance` (qubits, 3, 3) is that of (offset, contrast, tilt).
    """

    offset: FloatArray
    contrast: FloatArray
    tilt: FloatArray
    covariance: FloatArray


def polar_curves(fit: ResponseFit, native: NativeGates) -> PolarCurves:
    """The curves of the response circuit of `native` gates, as functions of the polar angle."""
    sign = math.cos(native.angle_offset_rad)
    b, c, s = (np.array(fit.curves) * [1.0, sign, sign]).T
    side = np.where(c < 0.0, -1.0, 1.0)
    contrast, tilt = side * np.hypot(c, s), np.arctan2(side * s, side * c)
    jacobian = np.zeros((len(b), 3, 3))  # of (offset, contrast, tilt) by (b, c, s)
    jacobian[:, 0, 0] = 1.0
    jacobian[:, 1, 1:] = sign * np.stack([c, s], axis=1) / contrast[:, None]
    jacobian[:, 2, 1:] = sign * np.stack([-s, c], axis=1) / contrast[:, None] ** 2
    covariance = jacobian @ np.array(fit.covariance) @ jacobian.transpose(0, 2, 1)
    return PolarCurves(b, contrast, tilt, covariance)
