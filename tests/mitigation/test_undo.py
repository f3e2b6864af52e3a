"""Undoing the effect of a qubit on <Z>: against cvxpy case by case, and against scatter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cvxpy
import numpy as np
import pytest
from scipy.stats import norm

from qcompile.calibration import Calibration
from qcompile.device import load_device
from qcompile.errors import CalibrationError
from qcompile.execution import OfflineExecutor, expectation_from_ones
from qcompile.ir import Circuit, Program
from qcompile.mitigation import (
    Mitigation,
    calibrate,
    readout_mitigation,
    response_mitigation,
)
from qcompile.passes import compile
from qcompile.policy.layouts import parallel

ONCE_IN_A_MILLION = norm.isf(0.5e-6)
Made = Callable[..., Calibration]


def on(calibration: Calibration, circuits: int, level: int = 2) -> Any:
    """`parallel` circuits, with polar angles, compiled for the calibration's device."""
    return compile(parallel(circuits, 1)[0], calibration.device, level)


@pytest.mark.parametrize("seed", range(3))
def test_apply_is_the_constrained_least_squares_solution(seed: int, made: Made) -> None:
    """min ||A p - f|| over distributions p, solved by cvxpy one case at a time."""
    rng = np.random.default_rng(seed)
    p10, p01 = rng.uniform(0, 0.2, 3), rng.uniform(0, 0.3, 3)
    calibration = made(readout=(p10.tolist(), p01.tolist()))
    executable = on(calibration, 3)
    measured = np.array([rng.uniform(-1, 1, 3), [1.0, -1.0, 0.99], [-1.0, 1.0, -0.99]])
    found = readout_mitigation(calibration, executable).apply(measured)
    outside = 0
    for circuit, qubit in enumerate(executable.qubits):
        matrix = np.array([[1 - p10[qubit], p01[qubit]], [p10[qubit], 1 - p01[qubit]]])
        for row in range(len(measured)):
            frequencies = np.array([1 + measured[row, circuit], 1 - measured[row, circuit]]) / 2
            p = cvxpy.Variable(2)
            problem = cvxpy.Problem(
                cvxpy.Minimize(cvxpy.sum_squares(matrix @ p - frequencies)),
                [p >= 0, cvxpy.sum(p) == 1],
            )
            problem.solve(solver=cvxpy.CLARABEL)
            assert found[row, circuit] == pytest.approx(p.value[0] - p.value[1], abs=1e-4)
            outside += abs(found[row, circuit]) == 1.0
    assert outside >= 3, "no case lies on the border of the constraint"


def test_each_circuit_gets_the_errors_of_its_qubit(made: Made) -> None:
    """Qubits named by their p10, kept in another order; with p01 = 0 z is seen as z - p10 (1+z)."""
    calibration = made(readout=([0.3, 0.1, 0.2], [0.0] * 3), qubits=(4, 6, 2), device=jakarta())
    circuits = np.array([4, 6, 6, 2, 4])
    executable = replace(compile(parallel(5, 1)[0], jakarta()), qubits=circuits)
    mitigation = readout_mitigation(calibration, executable)
    p10 = np.array([0.3, 0.1, 0.1, 0.2, 0.3])
    np.testing.assert_allclose(mitigation.contrast, 1 - p10)
    measured = 0.5 - p10 * 1.5
    np.testing.assert_allclose(mitigation.apply(measured[None]), np.full((1, 5), 0.5), atol=1e-15)
    with pytest.raises(CalibrationError, match=r"Qubit 5 has no calibration\.\n  .* 4 6 2"):
        readout_mitigation(calibration, replace(executable, qubits=circuits // 4 + 4))


def jakarta() -> Any:
    return load_device("fake_jakarta")


def test_only_shot_noise_remains(made: Made, noiseless_gates: Any) -> None:
    """Mitigated counts scatter about the truth by sqrt(1 - z^2) / (c sqrt(N)), without bias."""
    shots, device = 8192, noiseless_gates("fake_lima")
    executable = compile(parallel(5, 1)[0], device)
    x, theta = np.full((4000, 5), 0.4), np.linspace(-1, 1, 5)
    true = -np.sin(0.4) * np.cos(theta) - np.cos(0.4) ** 2 * np.sin(theta)
    executor = OfflineExecutor(device, seed=7)
    z = expectation_from_ones(executor.run(executable, x, theta, shots), shots)
    p10, p01 = ([getattr(q, name) for q in device.qubits] for name in ("p10", "p01"))
    mitigation = readout_mitigation(made(readout=(p10, p01), device=device), executable)
    found = mitigation.apply(z)
    offset, contrast = np.subtract(p01, p10), 1 - np.add(p01, p10)
    offset, contrast = offset[executable.qubits], contrast[executable.qubits]
    deviation = np.sqrt((1 - (offset + contrast * true) ** 2) / shots) / contrast
    mean_error = found.mean(axis=0) - true
    assert (np.abs(mean_error) < ONCE_IN_A_MILLION * deviation / np.sqrt(4000)).all()
    # the sample deviation of 4000 nearly normal draws has a relative error of 1/sqrt(8000)
    ratio = found.std(axis=0) / deviation
    assert (np.abs(ratio - 1) < ONCE_IN_A_MILLION / np.sqrt(8000)).all()
    said = mitigation.standard_error(z, shots).mean(axis=0)
    np.testing.assert_allclose(said, deviation, rtol=1e-2)


@pytest.mark.parametrize("tilt", [0.0, 0.3, -0.3])
def test_the_standard_error_is_the_scatter_of_calibration_and_counts(tilt: float) -> None:
    """Offset, contrast and tilt drawn from their covariance, counts from the true ones."""
    rng, draws, shots = np.random.default_rng(4), 20_000, 2000
    polar = np.array([0.8, 1.5, 2.2])
    root = 0.01 * np.array([[1.0, 0, 0], [0.5, 1, 0], [-0.3, 0.2, 1.5]])
    true = np.array([0.05, 0.85, tilt])
    z = true[0] + true[1] * np.cos(polar - tilt)
    measured = 1 - 2 * rng.binomial(shots, (1 - z) / 2, (draws, 3)) / shots
    o, c, t = true[:, None, None] + np.einsum("ij,jdk->idk", root, rng.normal(size=(3, draws, 3)))
    if tilt == 0:
        t = np.zeros_like(t)
        root[2] = 0
    # As `draws` calibrations, a row for each.
    found = np.stack(
        [
            Mitigation(*(v[:, k] for v in (o, c, t)), np.zeros((draws, 3, 3))).apply(measured[:, k])
            for k in range(3)
        ],
        axis=1,
    )
    known = Mitigation(*(np.full(3, v) for v in true), np.broadcast_to(root @ root.T, (3, 3, 3)))
    said = known.standard_error(z[None], shots)[0]
    np.testing.assert_allclose(found.std(axis=0), said, rtol=0.05)
    np.testing.assert_allclose(known.apply(z[None])[0], np.cos(polar), atol=1e-12)


def test_the_standard_error_is_finite_at_the_poles(made: Made) -> None:
    calibration = made(curves=[[0.02, -0.9, 0.05]], error=0.001)
    mitigation = response_mitigation(calibration, on(calibration, 1))
    errors = mitigation.standard_error(np.linspace(-1, 1, 101)[:, None], 100)
    assert np.isfinite(errors).all()
    assert (errors > 0).all()


@pytest.mark.parametrize("basis_gates", [("rz", "sx", "x"), ("rz", "rx")])
@pytest.mark.parametrize("s", [0.0, 0.08, -0.08])
def test_a_response_is_undone_with_its_tilt(
    made: Made, basis_gates: tuple[str, ...], s: float
) -> None:
    """Polar angles w in [0, pi] played by the curve b + c cos(a) + s sin(a), a = w + offset."""
    sign = 1 if "rx" in basis_gates else -1
    calibration = made(curves=[[0.04, sign * 0.85, s]], basis_gates=basis_gates)
    executable = on(calibration, 1)
    mitigation = response_mitigation(calibration, executable)
    tilt = np.arctan2(sign * s, 0.85)
    w = np.linspace(max(2 * tilt, 0), np.pi + min(2 * tilt, 0), 300)[:, None]
    a = w + executable.device.native.angle_offset_rad
    shown = 0.04 + sign * 0.85 * np.cos(a) + s * np.sin(a)
    np.testing.assert_allclose(mitigation.apply(shown), np.cos(w), atol=1e-9)
    beyond = mitigation.apply(np.array([[-0.99], [0.99]]))[:, 0]
    np.testing.assert_allclose(beyond, [-np.cos(min(tilt, 0)), np.cos(max(tilt, 0))], atol=1e-12)
    steps = np.diff(mitigation.apply(np.linspace(-1, 1, 1001)[:, None])[:, 0])
    assert (steps >= 0).all()


def test_a_tilt_is_left_where_the_side_is_not_known_or_the_tilt_not_seen(made: Made) -> None:
    program = Program.of([Circuit.parse("ry(x0)")], inputs=1)
    sure, unsure = (made(curves=[[0.0, -0.9, 0.01]], error=e) for e in (0.001, 0.01))
    either_side = compile(program, sure.device)
    assert not either_side.has_polar_angles
    assert not response_mitigation(sure, either_side).tilt.any()
    assert response_mitigation(sure, either_side, any_side=True).tilt.any()
    assert response_mitigation(sure, on(sure, 1)).tilt.any()
    assert not response_mitigation(unsure, on(unsure, 1)).tilt.any()


def test_response_removes_the_gate_error_that_readout_leaves() -> None:
    """Without shots: what readout mitigation leaves is far above what the response does."""
    device = load_device("fake_toronto")
    executable = compile(parallel(24, 1)[0], device)
    rng = np.random.default_rng(0)
    x, theta = rng.uniform(-1.5, 1.5, (200, 24)), rng.uniform(-3, 3, 24)
    true = -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)
    executor = OfflineExecutor(device)
    calibration = calibrate(executor, executable.qubits, None)
    z = executor.expectation(executable, x, theta)
    by_readout, by_response = (
        np.abs(undo(calibration, executable).apply(z) - true).max(axis=0)
        for undo in (readout_mitigation, response_mitigation)
    )
    assert by_response.max() < 1e-5
    assert by_readout.min() > 5e-4
    assert by_readout.max() > 0.01


def test_offset_and_contrast_of_the_readout_are_known_together(made: Made) -> None:
    """A <Z> read as |0> is depends on p10 alone, one read as |1> is on p01 alone.

    With z = 1 - 2 p10 kept, d<Z> / dp10 = 2 / contrast and d<Z> / dp01 = 0, and the other way.
    """
    calibration = made(readout=([0.05], [0.15]))
    assert calibration.readout is not None
    readout = calibration.readout.model_copy(update={"p10_error": (0.01,), "p01_error": (0.03,)})
    calibration = calibration.model_copy(update={"readout": readout})
    mitigation = readout_mitigation(calibration, on(calibration, 1))
    v10, v01 = 0.01**2, 0.03**2
    np.testing.assert_allclose(
        mitigation.covariance[0],
        [[v01 + v10, v10 - v01, 0], [v10 - v01, v01 + v10, 0], [0, 0, 0]],
        atol=1e-18,
    )
    errors = mitigation.standard_error(np.array([[0.9], [-0.7]]), 10**14)[:, 0]
    np.testing.assert_allclose(errors, [2 * 0.01 / 0.8, 2 * 0.03 / 0.8], rtol=1e-4)


@pytest.mark.parametrize("basis_gates", [("rz", "sx", "x"), ("rz", "rx")])
@pytest.mark.parametrize("s", [0.0, 0.08])
def test_a_response_that_is_swapped_is_undone(
    made: Made, basis_gates: tuple[str, ...], s: float
) -> None:
    """0 and 1 swapped turn the curve by pi: <Z> w shows 0.04 - 0.85 cos(w - tilt)."""
    sign = 1 if "rx" in basis_gates else -1
    calibration = made(curves=[[0.04, -sign * 0.85, s]], basis_gates=basis_gates, error=0.001)
    executable = on(calibration, 1)
    mitigation = response_mitigation(calibration, executable)
    assert mitigation.contrast[0] == pytest.approx(-np.hypot(0.85, s))
    tilt = np.arctan(-s / 0.85 * sign)
    assert mitigation.tilt[0] == pytest.approx(tilt)
    w = np.linspace(max(2 * tilt, 0), np.pi + min(2 * tilt, 0), 300)[:, None]
    a = w + executable.device.native.angle_offset_rad
    shown = 0.04 - sign * 0.85 * np.cos(a) + s * np.sin(a)
    np.testing.assert_allclose(mitigation.apply(shown), np.cos(w), atol=1e-9)
    assert (mitigation.standard_error(shown, 1000) > 0).all()


def test_a_readout_that_is_swapped_is_undone(made: Made) -> None:
    """P(0 | 1) = 0.96 and P(1 | 0) = 0.97: |0> is read as -0.94, |1> as 0.92."""
    calibration = made(readout=([0.97], [0.96]))
    mitigation = readout_mitigation(calibration, on(calibration, 1))
    measured = np.array([[-0.94], [0.92], [-0.01]])
    np.testing.assert_allclose(mitigation.apply(measured)[:, 0], [1, -1, 0], atol=1e-12)


@pytest.mark.parametrize("tilt", [0.3, 1.2, np.pi - 0.3, -2.0])
def test_a_turn_by_which_two_angles_look_alike_is_refused(made: Made, tilt: float) -> None:
    calibration = made(curves=[[0.0, -0.8 * np.cos(tilt), -0.8 * np.sin(tilt)]], error=0.001)
    with pytest.raises(CalibrationError, match=r"of qubit 0 is tilted by more than 0\.25 rad"):
        response_mitigation(calibration, on(calibration, 1))
    assert response_mitigation(calibration, on(calibration, 1), any_side=True).tilt.any()


def test_a_missing_calibration_is_refused(made: Made) -> None:
    readout, response = made(readout=([0.1], [0.1])), made(curves=[[0.0, -0.9, 0.0]])
    with pytest.raises(CalibrationError, match="has no assignment matrices"):
        readout_mitigation(response, on(response, 1))
    with pytest.raises(CalibrationError, match="has no response curves"):
        response_mitigation(readout, on(readout, 1))
    with pytest.raises(CalibrationError, match="need level 2, found level 1"):
        response_mitigation(response, on(response, 1, level=1))
    assert readout_mitigation(readout, on(readout, 1, level=0)).contrast[0] == pytest.approx(0.8)


@pytest.mark.parametrize("tilt", [0.2, -0.2])
def test_a_tilt_on_both_sides_is_undone_in_the_mean(tilt: float, made: Made) -> None:
    """cos(w - tilt) and cos(-w - tilt) are cos(w) cos(tilt) in the mean."""
    curve = [0.02, -0.9 * np.cos(tilt), -0.9 * np.sin(tilt)]  # of w + pi
    calibration = made(curves=[curve], error=1e-3)
    executable = compile(Program.of([Circuit.parse("ry(x0)")], 1), calibration.device)
    w = np.linspace(0.3, 2.8, 6)
    measured = 0.02 + 0.9 * np.cos(np.stack([w, -w]) - tilt)
    mitigation = response_mitigation(calibration, executable)
    mean = mitigation.apply(measured.reshape(-1, 1)).reshape(2, -1).mean(axis=0)
    inside = np.abs(measured - 0.02).max(axis=0) < 0.9 * np.cos(tilt)  # elsewhere it is clipped
    assert inside.sum() >= 3
    np.testing.assert_allclose(mean[inside], np.cos(w[inside]), atol=1e-12)


def test_the_mean_over_places_is_undone_once() -> None:
    """Two places of two circuits, tilts among them: the shares 0.75 and 0.25 of exact <Z>."""
    weights, w = np.array([0.75, 0.25]), np.linspace(0.4, 2.7, 30)[:, None]
    offset, contrast = np.array([0.1, -0.05, 0.02, 0.0]), np.array([0.7, 0.9, 0.8, 0.95])
    tilt = np.array([0.1, 0.0, -0.2, 0.0])
    places = Mitigation(offset, contrast, tilt, np.zeros((4, 3, 3)))
    shown = places.tilted_cosine(offset + contrast * np.cos(w - tilt))
    mean = 0.75 * shown[:, :2] + 0.25 * shown[:, 2:]
    np.testing.assert_allclose(
        places.of_mean(weights).apply(mean), np.cos(w) * np.ones(2), atol=1e-12
    )
    beyond = places.of_mean(weights).apply(np.array([[1.5, 1.5], [-1.5, -1.5]]))
    assert np.abs(beyond).max() <= 1.0
    np.testing.assert_array_equal(beyond[:, 1], [1.0, -1.0])


def test_the_errors_of_places_average() -> None:
    """Equal places of one circuit: half the variance, in units of what the mean shows."""
    covariance = np.diag([0.01, 0.02, 0.0])
    places = Mitigation(
        np.zeros(2), np.full(2, 0.5), np.zeros(2), np.broadcast_to(covariance, (2, 3, 3))
    )
    mean = places.of_mean(np.array([0.5, 0.5]))
    np.testing.assert_allclose(mean.covariance, [np.diag([0.02, 0.04, 0.0])])
    _, of_one = places.variances(np.array([[0.2, 0.2]]), 100)
    _, of_mean = mean.variances(np.array([[0.4]]), 100)
    assert of_mean[0, 0] == pytest.approx(of_one[0, 0] / 2)
