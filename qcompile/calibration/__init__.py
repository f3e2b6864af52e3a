"""Calibrations: what was counted on the qubits of a device, what was fitted to it, their files."""

from qcompile.calibration.calibration import (
    Calibration,
    age_words,
    is_calibration,
    load_calibration,
    load_counts,
)
from qcompile.calibration.counts import ReadoutCounts, ResponseCounts
from qcompile.calibration.fits import (
    INVERTIBLE_CONTRAST,
    MOST_ERROR,
    ReadoutFit,
    ResponseFit,
    weakness,
)

__all__ = [
    "INVERTIBLE_CONTRAST",
    "MOST_ERROR",
    "Calibration",
    "ReadoutCounts",
    "ReadoutFit",
    "ResponseCounts",
    "ResponseFit",
    "age_words",
    "is_calibration",
    "load_calibration",
    "load_counts",
    "weakness",
]
