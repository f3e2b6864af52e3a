"""The power of a twin check to detect a changed readout."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, chi2, kstest

from qcompile.calibration import Calibration
from qcompile.deploy.twin_check import check_twin, wide_observations
from qcompile.deploy.twin_power import EFFECT, POWER, TwinPrediction, choose_check, choose_rows
from qcompile.device import Device, load_device
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate
from qcompile.mitigation.drift import DRIFT_LEVEL
from qcompile.mitigation.measure import LIVE_ANGLES_RAD
from qcompile.passes import compile
from qcompile.policy import load_policy

TORONTO, POLICY = load_device("fake_toronto"), load_policy("lunarlander")
QUBITS = np.unique(compile(POLICY.trained_program, TORONTO, importance=POLICY.importance).qubits)


def live(seed: int, device: Device = TORONTO, shots: int = 8192) -> Calibration:
    executor = OfflineExecutor(device, seed)
    return calibrate(executor, QUBITS, shots, parts=["response"], angles_rad=LIVE_ANGLES_RAD)


@pytest.fixture(scope="module")
def twin() -> Calibration:
    return live(0)


@pytest.fixture(scope="module")
def wide(twin: Calibration) -> np.ndarray:
    return wide_observations(POLICY, twin, 0)


def test_the_power_is_how_often_moved_normal_residuals_are_found(
    twin: Calibration, wide: np.ndarray
) -> None:
    """Residuals of a qubit drawn with the covariance of shots and curve, and moved by a p01."""
    shots, draws = 1500, 20_000
    prediction = TwinPrediction.of(twin, POLICY, wide[:5])
    said = prediction.powers(shots, EFFECT)[-1]
    rng = np.random.default_rng(0)
    assert ((said > 0.05) & (said < 0.95)).sum() > 5
    for number in np.flatnonzero((said > 0.05) & (said < 0.95))[:3]:
        on = prediction.qubit_of == number
        design, z = prediction.design[:, on].reshape(-1, 3), prediction.expected[:, on].ravel()
        covariance = design @ prediction.covariance[number] @ design.T + np.diag((1 - z**2) / shots)
        qubit = TORONTO.qubits[prediction.qubits[number]]
        before_readout = (z - (qubit.p01 - qubit.p10)) / qubit.contrast
        moved = EFFECT * (1 - before_readout)
        residuals = moved + rng.multivariate_normal(np.zeros(len(z)), covariance, draws)
        found = np.einsum("di,ij,dj->d", residuals, np.linalg.inv(covariance), residuals)
        share = np.mean(found > chi2.isf(DRIFT_LEVEL / len(QUBITS), len(z)))
        # What gates leave of <Z> is not in `before_readout`: some percent of the move.
        assert share == pytest.approx(said[number], abs=0.06)


def test_the_defaults_find_what_they_say(twin: Calibration, wide: np.ndarray) -> None:
    """A p01 raised by 0.05 on one of 24 qubits, each time another one and another calibration."""
    observations, shots, _ = choose_check(twin, POLICY, wide)
    assert len(observations) >= 4
    assert len(observations) * shots * 0.00035 + 2 < 9, "what the documentation allows"
    found, times = 0, 24
    for seed, qubit in enumerate(QUBITS.tolist()):
        records = list(TORONTO.qubits)
        records[qubit] = records[qubit].model_copy(update={"p01": records[qubit].p01 + EFFECT})
        machine = OfflineExecutor(TORONTO.model_copy(update={"qubits": tuple(records)}), seed)
        check = check_twin(live(100 + seed), POLICY, observations, machine, shots)
        found += qubit in check.failed
        assert set(check.failed) <= {qubit}
    assert found >= binom.ppf(1e-3, times, POWER)


def test_a_right_twin_has_uniform_p_values(twin: Calibration, wide: np.ndarray) -> None:
    observations, shots, _ = choose_check(twin, POLICY, wide)
    p_values = []
    for seed in range(40):
        machine = OfflineExecutor(TORONTO, 10_000 + seed)
        p_values.append(check_twin(live(seed), POLICY, observations, machine, shots).p_value)
    assert kstest(np.concatenate(p_values), "uniform").pvalue > 1e-3


def test_no_fewer_shots_have_the_power(twin: Calibration, wide: np.ndarray) -> None:
    observations, shots, power = choose_check(twin, POLICY, wide, power=0.8)
    prediction = TwinPrediction.of(twin, POLICY, observations)
    assert power == pytest.approx(prediction.powers(shots, EFFECT)[-1].min())
    assert power >= 0.8 > prediction.powers(int(0.85 * shots), EFFECT)[-1].min()
    _, more, _ = choose_check(twin, POLICY, wide, power=0.99)
    assert more > shots
    _, fewer, _ = choose_check(twin, POLICY, wide, power=0.8, effect=2 * EFFECT)
    assert fewer < shots


def test_what_is_given_stays(twin: Calibration, wide: np.ndarray) -> None:
    observations, _, power = choose_check(twin, POLICY, wide, rows=9)
    assert (len(observations), power >= POWER) == (9, True)
    _, shots, power = choose_check(twin, POLICY, wide, shots=1500)
    assert (shots, power >= POWER) == (1500, True)
    observations, shots, power = choose_check(twin, POLICY, wide, rows=2, shots=77)
    assert (len(observations), shots) == (2, 77)
    assert power < 0.1


def test_a_coarse_calibration_is_not_made_up_for_by_executions(wide: np.ndarray) -> None:
    """With 150 shots its own errors hide the effect."""
    observations, shots, power = choose_check(live(0, shots=150), POLICY, wide)
    assert len(observations) * shots <= 16 * 4 * 150
    assert power < POWER


def test_rows_are_chosen_that_show_every_qubit() -> None:
    """Row 1 shows both qubits well, row 2 the one that it shows least; none twice before all."""
    visibility = np.array([[0.1, 0.1], [2.0, 1.0], [0.0, 3.0], [1.0, 0.0]])
    assert choose_rows(visibility, 2).tolist() == [1, 2]
    assert sorted(choose_rows(visibility, 4)) == [0, 1, 2, 3]
    assert choose_rows(visibility, 5)[4] in (1, 2)
