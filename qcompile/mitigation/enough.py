"""How many shots a calibration needs: as few as the shots of what it mitigates ask for."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import CircuitShots, FloatArray
from qcompile.execution.offline import OfflineExecutor
from qcompile.mitigation.measure import CALIBRATION_SHOTS, Part, calibrate
from qcompile.mitigation.undo import Mitigation, readout_mitigation, response_mitigation
from qcompile.passes import Executable

MIN_SHOTS = 256
"""Fewer save next to nothing, and chi-square holds no longer: right response curves are doubted."""
SHARE = 0.05
"""What the variance of the calibration may be of that of shot noise."""
_Z = (np.arange(32) + 0.5) / 16 - 1
"""Ideal `<Z>` over which variances are averaged."""


def enough_shots(
    executable: Executable, part: Part, shots: CircuitShots, importance: FloatArray
) -> int:
    """The shots of a calibration whose own counting noise matters little beside that of `shots`.

    A calibration errs once, for the whole run. Its error of `<Z>` is taken as a variance, that of
    `Mitigation.variances`, to be at most SHARE of the variance of the shot noise of a row:

        sum over circuits of importance * calibrated  <=  SHARE * sum of importance * counted,

    both averaged over ideal `<Z>` in [-1, 1], as placement averages them. `importance` (circuits,)
    is what a square error of a circuit's `<Z>` costs (`Policy.importance`); where a circuit stands
    in several places, each has its own, and for a mean over places it has the squares of their
    weights. The covariance is that of a calibration of the noise model: it falls as 1 / shots. The
    result is a power of two in [MIN_SHOTS, CALIBRATION_SHOTS].
    """
    model = OfflineExecutor(executable.device, 0)
    known = calibrate(model, executable.qubits, CALIBRATION_SHOTS, parts=[part])
    mitigation = (
        readout_mitigation(known, executable)
        if part == "readout"
        else response_mitigation(known, executable, any_side=True)
    )
    counted, calibrated = mitigation.variances(_measured_z(mitigation), shots)
    noise, error = (counted * importance).sum(), (calibrated * importance).sum()
    if not error:
        return MIN_SHOTS
    wanted = CALIBRATION_SHOTS * error / (SHARE * noise)
    return int(2 ** np.ceil(np.log2(np.clip(wanted, MIN_SHOTS, CALIBRATION_SHOTS))))


def _measured_z(mitigation: Mitigation) -> FloatArray:
    """What circuits of ideal `<Z>` show, (numbers, circuits)."""
    polar = np.arccos(_Z)[:, None] - mitigation.tilt
    return np.asarray(mitigation.offset + mitigation.contrast * np.cos(polar))
