"""Fresh counts against a calibration: how often it is rejected, and what makes it fail."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, kstest

from qcompile.calibration import Calibration
from qcompile.device import Device, load_device
from qcompile.errors import CalibrationError
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate, measure_drift
from qcompile.mitigation.drift import DRIFT_LEVEL

TORONTO = load_device("fake_toronto")
SHOTS = 1024


def measured(seed: int, device: Device = TORONTO, shots: int | None = SHOTS) -> Calibration:
    return calibrate(OfflineExecutor(device, seed), np.arange(27), shots)


def test_a_device_that_stays_is_seldom_contradicted() -> None:
    """60 comparisons with another calibration each; p-values of 27 qubits are uniform."""
    runs = 60
    found = [measure_drift(measured(2 * k), measured(2 * k + 1)) for k in range(runs)]
    alarms = sum(bool(drift.drifted) for drift in found)
    assert alarms <= binom.isf(1e-6, runs, DRIFT_LEVEL)
    p_values = np.concatenate([drift.p_value for drift in found])
    assert kstest(p_values, "uniform").pvalue > 1e-3
    for level in (0.5, 0.1, 0.01, 0.001):
        share = np.count_nonzero(p_values < level)
        assert share <= binom.isf(1e-6, p_values.size, level), level
        assert share >= binom.ppf(1e-6, p_values.size, level), level
    assert found[0].degrees_of_freedom == 2 + 8


def test_a_qubit_that_changed_is_named() -> None:
    qubits = list(TORONTO.qubits)
    qubits[11] = qubits[11].model_copy(update={"p01": qubits[11].p01 + 0.04})
    moved = Device(**TORONTO.model_dump() | {"qubits": tuple(qubits)})
    for seed in range(5):
        drift = measure_drift(measured(seed), measured(100 + seed, moved))
        assert drift.drifted == [11]
        assert drift.p_value[11] == drift.p_value.min()


def test_fewer_qubits_and_parts_are_compared_where_both_have_them() -> None:
    executor = OfflineExecutor(TORONTO, 9)
    fresh = calibrate(executor, np.array([8, 3]), 500, parts=["readout"])
    drift = measure_drift(measured(1), fresh)
    assert drift.qubits.tolist() == [3, 8]
    assert drift.degrees_of_freedom == 2
    assert drift.drifted == []


def test_the_chi_square_by_hand() -> None:
    """One qubit, 1000 shots of each bit: 20 and 40 ones of |0>, 950 both times of |1>."""
    old, fresh = (
        calibrate(OfflineExecutor(TORONTO, 0), np.array([0]), 1000, parts=["readout"])
        for _ in range(2)
    )
    old, fresh = (
        c.model_copy(
            update={"readout_counts": c.readout_counts.model_copy(update={"ones": ((k,), (950,))})}
        )
        for c, k in ((old, 20), (fresh, 40))
    )
    pooled = 60.5 / 2001
    drift = measure_drift(old, fresh)
    assert drift.chi_square[0] == pytest.approx(0.02**2 / (pooled * (1 - pooled) * 2 / 1000))


def test_incomparable_calibrations_are_refused() -> None:
    calibration = measured(1)
    lima = calibrate(OfflineExecutor(load_device("fake_lima"), 1), np.arange(5), 100)
    with pytest.raises(
        CalibrationError, match="for fake_toronto, the fresh counts are from fake_lim"
    ):
        measure_drift(calibration, lima)
    with pytest.raises(CalibrationError, match="without shots"):
        measure_drift(calibration, measured(1, shots=None))
    executor = OfflineExecutor(TORONTO, 1)
    some = calibrate(executor, np.array([0]), 100)
    with pytest.raises(CalibrationError, match="Qubit 1 has no calibration"):
        measure_drift(some, calibration)
    other = calibrate(executor, np.array([0]), 100, angles_rad=np.arange(8.0))
    with pytest.raises(CalibrationError, match="different angles"):
        measure_drift(calibration, other)
    readout = calibrate(executor, np.array([0]), 100, parts=["readout"])
    response = calibrate(executor, np.array([0]), 100, parts=["response"])
    with pytest.raises(CalibrationError, match="no counts in common"):
        measure_drift(readout, response)
