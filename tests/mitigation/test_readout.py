"""Readout mitigation: the fit, its inverse, and what is left of the error."""

from __future__ import annotations

import cvxpy
import numpy as np
import pytest
from scipy.stats import norm

from qcompile.device import Device, GateCalibration, Qubit, load_device
from qcompile.errors import CalibrationError
from qcompile.execution import OfflineExecutor, expectation_from_ones
from qcompile.mitigation import CALIBRATION_SHOTS, ReadoutMitigation, calibrate_readout
from qcompile.mitigation.readout import fit_assignment
from qcompile.passes import compile
from qcompile.policy.layouts import parallel

ONCE_IN_A_MILLION = norm.isf(0.5e-6)


def noiseless_gates(name: str) -> Device:
    """The device with its own readout and perfect gates: its only error is assignment."""
    device = load_device(name)
    qubits = tuple(qubit.model_copy(update={"gates": {}}) for qubit in device.qubits)
    return device.model_copy(update={"qubits": qubits})


def exact_mitigation(device: Device) -> ReadoutMitigation:
    """The matrices the device file states, typed in its convention A[measured, prepared]."""
    matrices = [[[1 - q.p10, q.p01], [q.p10, 1 - q.p01]] for q in device.qubits]
    return ReadoutMitigation(np.arange(len(matrices)), np.array(matrices))


def test_the_fit_is_the_observed_frequencies() -> None:
    found = fit_assignment(np.array([0.010, 0.250]), np.array([0.970, 0.400]), np.array([4, 7]))
    by_hand = [[[0.990, 0.030], [0.010, 0.970]], [[0.750, 0.600], [0.250, 0.400]]]
    np.testing.assert_allclose(found, by_hand, atol=1e-6)


@pytest.mark.parametrize(("ones_of_0", "ones_of_1"), [(0, 8192), (8192, 0), (0, 400), (8000, 8192)])
def test_columns_are_distributions_at_the_extremes(ones_of_0: int, ones_of_1: int) -> None:
    p_one = np.array([[ones_of_0], [ones_of_1]]) / 8192
    found = fit_assignment(*p_one, np.array([0]))
    np.testing.assert_allclose(found.sum(axis=1), 1, atol=1e-15)
    assert ((found >= 0) & (found <= 1)).all()
    np.testing.assert_allclose(found[0, 1], [ones_of_0 / 8192, ones_of_1 / 8192], atol=1e-6)


def test_no_contrast_is_refused() -> None:
    with pytest.raises(CalibrationError, match="Qubit 9 tells") as caught:
        fit_assignment(np.array([0.01, 0.5]), np.array([0.99, 0.51]), np.array([4, 9]))
    assert "P(1|0) = 0.500 and P(1|1) = 0.510" in str(caught.value)


@pytest.mark.parametrize("seed", range(4))
def test_apply_is_the_constrained_least_squares_solution(seed: int) -> None:
    """min ||A p - f|| over distributions p, solved by cvxpy one case at a time."""
    rng = np.random.default_rng(seed)
    p10, p01 = rng.uniform(0, 0.2, 3), rng.uniform(0, 0.3, 3)
    matrices = np.moveaxis(np.array([[1 - p10, p01], [p10, 1 - p01]]), 2, 0)
    measured = np.array([rng.uniform(-1, 1, 3), [1.0, -1.0, 0.99], [-1.0, 1.0, -0.99]])
    found = ReadoutMitigation(np.arange(3), matrices).apply(measured)
    outside = 0
    for row in range(len(measured)):
        for qubit in range(3):
            frequencies = np.array([1 + measured[row, qubit], 1 - measured[row, qubit]]) / 2
            p = cvxpy.Variable(2)
            problem = cvxpy.Problem(
                cvxpy.Minimize(cvxpy.sum_squares(matrices[qubit] @ p - frequencies)),
                [p >= 0, cvxpy.sum(p) == 1],
            )
            problem.solve(solver=cvxpy.CLARABEL)
            assert found[row, qubit] == pytest.approx(p.value[0] - p.value[1], abs=1e-4)
            outside += abs(found[row, qubit]) == 1.0
    assert outside >= 3, "no case lies on the border of the constraint"


def test_calibration_finds_the_device_s_own_errors() -> None:
    """Each entry within the binomial error of a million shots."""
    shots, device = 1_000_000, noiseless_gates("fake_lima")
    executor = OfflineExecutor(device, seed=5)
    found = calibrate_readout(executor, np.arange(5), shots).assignment
    stated = exact_mitigation(device).assignment
    bound = ONCE_IN_A_MILLION * np.sqrt(stated * (1 - stated) / shots) + 1e-6
    assert (np.abs(found - stated) < bound).all()


def test_the_systematic_error_is_removed() -> None:
    """Without shot noise the mitigated error is that of the calibration alone.

    z' = (z - b) / c with b = p01 - p10 and c = 1 - p01 - p10. A calibration error d10, d01 moves it
    by d10 (1 + z) / c and d01 (1 - z) / c, so its deviation is at most their quadrature.
    """
    shots, device = 4_000_000, noiseless_gates("fake_lima")
    executable = compile(parallel(5, 1)[0], device)
    rng = np.random.default_rng(0)
    x, theta = rng.uniform(-1.5, 1.5, (200, 5)), rng.uniform(-3, 3, 5)
    true = -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)

    executor = OfflineExecutor(device, seed=6)
    measured = executor.expectation(executable, x, theta)
    mitigation = calibrate_readout(executor, executable.qubits, shots).at(executable.qubits)
    qubits = [device.qubits[q] for q in executable.qubits]
    p10, p01 = np.array([q.p10 for q in qubits]), np.array([q.p01 for q in qubits])
    spread = np.sqrt(
        p10 * (1 - p10) / shots * (1 + true) ** 2 + p01 * (1 - p01) / shots * (1 - true) ** 2
    ) / (1 - p10 - p01)
    error = np.abs(mitigation.apply(measured) - true)
    assert (error < ONCE_IN_A_MILLION * spread + 1e-6).all()
    assert np.abs(measured - true).max() > 0.05
    assert error.max() < 0.003


def test_shot_noise_is_what_is_left() -> None:
    """Mitigated counts scatter about the truth by sqrt(1 - z^2) / (c sqrt(N)), without bias."""
    shots, device = 8192, noiseless_gates("fake_lima")
    executable = compile(parallel(5, 1)[0], device)
    x, theta = np.full((4000, 5), 0.4), np.linspace(-1, 1, 5)
    true = -np.sin(0.4) * np.cos(theta) - np.cos(0.4) ** 2 * np.sin(theta)
    executor = OfflineExecutor(device, seed=7)
    z = expectation_from_ones(executor.run(executable, x, theta, shots), shots)
    mitigation = exact_mitigation(device).at(executable.qubits)
    found = mitigation.apply(z)
    qubits = [device.qubits[q] for q in executable.qubits]
    offset, contrast = (
        np.array([q.p01 - q.p10 for q in qubits]),
        np.array([1 - q.p01 - q.p10 for q in qubits]),
    )
    deviation = np.sqrt((1 - (offset + contrast * true) ** 2) / shots) / contrast
    mean_error = found.mean(axis=0) - true
    assert (np.abs(mean_error) < ONCE_IN_A_MILLION * deviation / np.sqrt(4000)).all()
    # the sample deviation of 4000 nearly normal draws has a relative error of 1/sqrt(8000)
    ratio = found.std(axis=0) / deviation
    assert (np.abs(ratio - 1) < ONCE_IN_A_MILLION / np.sqrt(8000)).all()


def test_calibration_of_a_perfect_device_changes_nothing() -> None:
    executor = OfflineExecutor(load_device("ideal"), 0)
    mitigation = calibrate_readout(executor, np.arange(3))
    z = np.array([[0.2, -1.0, 1.0]])
    np.testing.assert_allclose(mitigation.apply(z), z, atol=1e-6)
    assert CALIBRATION_SHOTS == 8192


def test_each_circuit_gets_the_matrix_of_its_qubit() -> None:
    """Matrices named by their p10; circuits repeat qubits and take them in another order."""
    p10 = np.array([0.1, 0.2, 0.3])
    matrices = np.moveaxis(np.array([[1 - p10, 0 * p10], [p10, 1 + 0 * p10]]), 2, 0)
    calibrated = ReadoutMitigation(np.array([6, 2, 4]), matrices)
    circuits = np.array([4, 6, 6, 2, 4])
    chosen = calibrated.at(circuits)
    np.testing.assert_array_equal(chosen.assignment[:, 1, 0], [0.3, 0.1, 0.1, 0.2, 0.3])
    # with p01 = 0 a true z = 0.5 is measured as z - p10 (1 + z)
    measured = 0.5 - chosen.assignment[:, 1, 0] * 1.5
    np.testing.assert_allclose(chosen.apply(measured[None]), np.full((1, 5), 0.5), atol=1e-15)


def test_calibration_keeps_each_qubit_s_own_errors() -> None:
    """Asked for in any order and more than once, a qubit is measured once, under its own number."""
    device = noiseless_gates("fake_lima")
    mitigation = calibrate_readout(OfflineExecutor(device, 8), np.array([3, 0, 3, 4]), 1_000_000)
    assert sorted(mitigation.qubits.tolist()) == [0, 3, 4]
    for qubit in (0, 3, 4):
        found = mitigation.at(np.array([qubit])).assignment[0, 0, 1]
        stated = device.qubits[qubit].p01
        spread = np.sqrt(stated * (1 - stated) / 1_000_000)
        assert abs(found - stated) < ONCE_IN_A_MILLION * spread + 1e-6


def test_a_qubit_without_calibration_is_named() -> None:
    calibrated = ReadoutMitigation(np.array([0, 2]), np.stack([np.eye(2)] * 2))
    with pytest.raises(CalibrationError, match=r"Qubit 1 has no calibration\.\n  Calibrated: 0 2"):
        calibrated.at(np.array([0, 1, 2]))


def test_exact_calibration_is_the_device_s_own_errors() -> None:
    """No shots, no scatter: 1e-6 is the accuracy of the fit, the seed does not matter."""
    device = noiseless_gates("fake_lima")
    found = [
        calibrate_readout(OfflineExecutor(device, seed), np.arange(5), None).assignment
        for seed in (1, 2)
    ]
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_allclose(found[0], exact_mitigation(device).assignment, atol=1e-6)


def test_an_rx_device_prepares_one_with_its_own_rx() -> None:
    """|1> is made by Rx(pi), worked by hand: what its noise keeps of r_z counts as p01.

    T1 = T2 = 100 us and 50 ns leave e = exp(-0.0005) of every component; the gate error of 0.02 is
    reached by depolarising with p = 2 (0.02 - (1 - e) / 2) / e. After Rx(pi) r_z is -1, then
    r = 1 - e - e (1 - p), and P(read 0) = (1 - p10) (1 + r) / 2 + p01 (1 - r) / 2.
    """
    gates = {"rx": GateCalibration(error=0.02, length_ns=50)}
    qubit = Qubit(t1_us=100, t2_us=100, p10=0.01, p01=0.03, gates=gates)
    device = Device(name="rx", source="by hand", basis_gates=("rz", "rx"), qubits=(qubit,))
    found = calibrate_readout(OfflineExecutor(device), np.array([0]), None).assignment[0]
    e = np.exp(-0.0005)
    p = 2 * (0.02 - (1 - e) / 2) / e
    r = 1 - e - e * (1 - p)
    zero_of_one = 0.99 * (1 + r) / 2 + 0.03 * (1 - r) / 2
    assert zero_of_one > 0.045
    by_hand = [[0.99, zero_of_one], [0.01, 1 - zero_of_one]]
    np.testing.assert_allclose(found, by_hand, atol=1e-6)
