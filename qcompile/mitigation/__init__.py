"""Mitigation: measured and fitted once with cvxpy, applied in closed form."""

from qcompile.mitigation.drift import Drift, measure_drift
from qcompile.mitigation.measure import CALIBRATION_SHOTS, calibrate, calibration_workload
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
    "Mitigation",
    "calibrate",
    "calibration_workload",
    "check_response_level",
    "measure_drift",
    "predistorted",
    "readout_mitigation",
    "response_mitigation",
]
