"""Calibrations: the counts measured on the qubits of a device, their fits, and their files."""

from qcompile.calibration.calibration import (
    Calibration,
    age_warnings,
    is_calibration,
    load_calibration,
    load_counts,
)
from qcompile.calibration.counts import ReadoutCounts, ResponseCounts
from qcompile.calibration.fits import (
    INVERTIBLE_CONTRAST,
    MAX_ERROR,
    ReadoutFit,
    ResponseFit,
    fit_problems,
)

__all__ = [
    "INVERTIBLE_CONTRAST",
    "MAX_ERROR",
    "Calibration",
    "ReadoutCounts",
    "ReadoutFit",
    "ResponseCounts",
    "ResponseFit",
    "age_warnings",
    "fit_problems",
    "is_calibration",
    "load_calibration",
    "load_counts",
]
