"""Testing whether a calibration is still valid, against fresh counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.calibration import Calibration, ReadoutCounts, ResponseCounts
from qcompile.errors import CalibrationError

DRIFT_LEVEL = 0.001
"""The probability that a valid calibration is rejected, for all its qubits together."""


@dataclass(frozen=True, eq=False)
class Drift:
    """Chi-square of each qubit's fresh counts against the calibration, with its p-value.

    `qubits`, `chi_square` and `p_value` are (qubits,); `drifted` lists the qubits that are
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
    """Compare the counts of `fresh` with those of `old`, on the qubits of `fresh`.

    If nothing drifted, the two frequencies of a circuit differ by shot noise only: the sum of
    squared differences over their variances is then chi-square distributed, with one degree of
    freedom for each circuit.

    Raises:
        CalibrationError: the devices or angles differ, `old` lacks a qubit, the calibrations have
            no circuit in common, or one has no shots.
    """
    if old.backend != fresh.backend:
        raise CalibrationError(
            f"The calibration is for {old.backend}, the fresh counts are from {fresh.backend}.",
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
    for old_counts, fresh_counts in zip(_frequencies(old), _frequencies(fresh), strict=True):
        if old_counts is None or fresh_counts is None:
            continue
        p_before, shots_before = old_counts[0][:, rows], old_counts[1]
        p_after, shots_after = fresh_counts
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
    """For readout and response: the frequencies of ones (circuits, qubits) to compare, and shots.

    Readout frequencies are averaged over the patterns of each bit, which gives two rows.
    """
    frequencies: list[tuple[FloatArray, int] | None] = []
    for counts in (calibration.readout_counts, calibration.response_counts):
        if counts is None:
            frequencies.append(None)
            continue
        if counts.shots is None:
            raise CalibrationError("A calibration without shots has no shot noise to compare with.")
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
