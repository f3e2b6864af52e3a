"""Mitigation: errors are measured, fitted once (by cvxpy if a constraint binds), and inverted in
closed form."""

from qcompile.mitigation.drift import Drift, measure_drift
from qcompile.mitigation.enough import enough_product_shots, enough_shots
from qcompile.mitigation.measure import (
    CALIBRATION_SHOTS,
    calibrate,
    calibration_workload,
    fit_counts,
)
from qcompile.mitigation.misfit import Misfit, misfits
from qcompile.mitigation.predistort import predistorted
from qcompile.mitigation.undo import (
    Mitigation,
    check_response_level,
    readout_mitigation,
    response_mitigation,
)

__all__ = [
    "CALIBRATION_SHOTS",
    "Drift",
    "Misfit",
    "Mitigation",
    "calibrate",
    "calibration_workload",
    "check_response_level",
    "enough_product_shots",
    "enough_shots",
    "fit_counts",
    "measure_drift",
    "misfits",
    "predistorted",
    "readout_mitigation",
    "response_mitigation",
]
