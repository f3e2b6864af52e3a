"""Whether a calibration still holds: fresh counts against what it says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.calibration import Calibration, ReadoutCounts, ResponseCounts
from qcompile.errors import CalibrationError

DRIFT_LEVEL = 0.001
"""A calibration that holds is contradicted this often, all its qubits together."""


@dataclass(frozen=True, eq=False)
class Drift:
    """Chi-square of each qubit's fresh counts against the calibration, with its p-value.

    `qubits`, `chi_square` and `p_value` are (qubits,); `drifted` are the qubits that are
    `contradicted`.
    """

    qubits: IntArray
    chi_square: FloatArray
    degrees_of_freedom: int
    p_value: FloatArray

    @property
    def drifted(self) -> list[int]:
        return contradicted(self.qubits, self.p_value)


def contradicted(qubits: IntArray, p_value: FloatArray) -> list[int]:
    """The qubits (n,) whose p-value lies below DRIFT_LEVEL divided by their number (Bonferroni)."""
    return [int(q) for q in qubits[p_value < DRIFT_LEVEL / len(qubits)]]


def measure_drift(old: Calibration, fresh: Calibration) -> Drift:
    """Compare the counts of `fresh` with those of `old`, on the qubits that `fresh` has.

    Each pair of frequencies of the same circuit differs by shot noise alone where nothing moved:
    the sum of squares over their variances is then chi-square distributed, a degree of freedom for
    each circuit.

    Raises:
        CalibrationError: another device, a qubit that `old` lacks, other angles, no circuit in
            common, or calibrations without shots.
    """
    if old.backend != fresh.backend:
        raise CalibrationError(
            f"The calibration is of {old.backend}, the fresh counts are of {fresh.backend}.",
            "Compare calibrations of one device.",
        )
    rows = old.rows(np.array(fresh.qubits))
    before, after = old.response_counts, fresh.response_counts
    if before and after and not np.array_equal(before.angles[:, rows], after.angles):
        raise CalibrationError(
            "The calibrations were measured at different angles.",
            "Measure the fresh counts at the angles of the calibration.",
        )
    total, degrees = np.zeros(len(rows)), 0
    for was, now in zip(_frequencies(old), _frequencies(fresh), strict=True):
        if was is None or now is None:
            continue
        p_before, shots_before = was[0][:, rows], was[1]
        p_after, shots_after = now
        pooled = (p_before * shots_before + p_after * shots_after + 0.5) / (
            shots_before + shots_after + 1
        )
        spread = pooled * (1 - pooled) * (1 / shots_before + 1 / shots_after)
        total += ((p_before - p_after) ** 2 / spread).sum(axis=0)
        degrees += len(p_before)
    if not degrees:
        raise CalibrationError("The calibrations have no counts in common.")
    from scipy.stats import chi2

    return Drift(np.array(fresh.qubits), total, degrees, chi2.sf(total, degrees))


def _frequencies(calibration: Calibration) -> list[tuple[FloatArray, int] | None]:
    """For readout and response: frequencies of ones (circuits, qubits) that compare, and shots.

    Readout frequencies are averaged over the patterns of a bit: two rows.
    """
    frequencies: list[tuple[FloatArray, int] | None] = []
    for counts in (calibration.readout_counts, calibration.response_counts):
        if counts is None:
            frequencies.append(None)
            continue
        if counts.shots is None:
            raise CalibrationError("A calibration without shots has no scatter to compare.")
        frequencies.append(_rows(counts, counts.shots))
    return frequencies


def _rows(counts: ReadoutCounts | ResponseCounts, shots: int) -> tuple[FloatArray, int]:
    frequency = np.array(counts.ones) / shots
    if isinstance(counts, ResponseCounts):
        return frequency, shots
    prepared = np.array(counts.prepared)
    means = [
        (frequency * (prepared == bit)).sum(axis=0) / (prepared == bit).sum(axis=0)
        for bit in (0, 1)
    ]
    return np.array(means), shots * len(prepared) // 2
