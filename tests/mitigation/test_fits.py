"""The fits of readout and response against closed forms, another solver, and their scatter."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

from qcompile.calibration import MAX_ERROR
from qcompile.errors import CalibrationError
from qcompile.mitigation import fits
from qcompile.mitigation.fits import fit_readout, fit_response
from qcompile.mitigation.measure import RESPONSE_ANGLES_RAD, patterns

ONCE_IN_A_MILLION = norm.isf(0.5e-6)
SHOTS = 8192
ANGLES = RESPONSE_ANGLES_RAD


def pair(*ones: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """All qubits in |0>, then all in |1>, and the ones counted."""
    return np.outer([0, 1], np.ones(len(ones[0]), dtype=int)), np.array(ones, dtype=float)


def drawn_to_the_mean(frequency: np.ndarray, shots: float) -> np.ndarray:
    """clip((n mean + w common) / (n + w)), the closed form of the fit, for (2, qubits)."""
    w, common = fits.PRIOR_SHOTS, frequency.mean(axis=1, keepdims=True)
    return np.clip((shots * frequency + w * common) / (shots + w), 0, 1)


@pytest.mark.parametrize("shots", [60, 100, 8192])
def test_the_fit_is_the_closed_form(shots: int) -> None:
    prepared, ones = pair(
        [0.05 * shots, 0.20 * shots, 0.0, 0.1 * shots],
        [0.9 * shots, 0.75 * shots, shots, 0.95 * shots],
    )
    found = fit_readout(prepared, ones, shots, np.array([4, 7, 9, 12]))
    by_hand = drawn_to_the_mean(ones / shots, shots)
    np.testing.assert_allclose(found.p10, by_hand[0], atol=1e-6)
    np.testing.assert_allclose(found.p01, 1 - by_hand[1], atol=1e-6)


def test_the_closed_form_of_the_readout_is_the_least_squares_of_cvxpy() -> None:
    """Weighted by shot noise, with the prior, within [0, 1]."""
    import cvxpy

    prepared, ones = pair([5.0, 0.0, 30.0], [190.0, 200.0, 160.0])
    mean, shots = ones / 200, 200
    p_one, common = cvxpy.Variable((2, 3)), mean.mean(axis=1, keepdims=True) * np.ones((1, 3))
    weights = 1 / (((ones + 0.5) / 201) * (1 - (ones + 0.5) / 201))
    misfit = cvxpy.multiply(weights * shots, cvxpy.square(p_one - mean))
    prior = cvxpy.multiply(weights * fits.PRIOR_SHOTS, cvxpy.square(p_one - common))
    constraints = [p_one >= 0, p_one <= 1]
    cvxpy.Problem(cvxpy.Minimize(cvxpy.sum(misfit + prior)), constraints).solve(solver="CLARABEL")
    found = fit_readout(prepared, ones, shots, np.arange(3))
    np.testing.assert_allclose([found.p10, 1 - np.array(found.p01)], p_one.value, atol=1e-5)


def test_the_prior_by_hand() -> None:
    """Ones of |0>: 2 and 8 of 40, mean 0.125 of 10 both: (40 * 0.05 + 8 * 0.125) / 48 = 0.0625."""
    prepared, ones = pair([2, 8], [40, 36])
    found = fit_readout(prepared, ones, 40, np.array([0, 1]))
    np.testing.assert_allclose(found.p10, [0.0625, 0.1875], atol=1e-6)
    np.testing.assert_allclose(found.p01, [0.1 * 0 + 8 * 0.05 / 48, (4 + 0.4) / 48], atol=1e-6)


def test_one_qubit_alone_has_no_prior() -> None:
    prepared, ones = pair([2], [38])
    found = fit_readout(prepared, ones, 40, np.array([3]))
    np.testing.assert_allclose([*found.p10, *found.p01], [0.05, 0.05], atol=1e-6)


def test_patterns_are_averaged_and_tested() -> None:
    """Qubit 0 has 10, 30 ones of 1000 in |0>: 2 %; chi-square (0.01^2 + 0.01^2) / (p q / 1000)."""
    prepared = np.array([[0], [1], [0], [1]])
    found = fit_readout(prepared, np.array([[10.0], [900], [30], [900]]), 1000, np.array([0]))
    np.testing.assert_allclose([*found.p10, *found.p01], [0.02, 0.1], atol=1e-6)
    p = 40.5 / 2001
    assert found.chi_square[0] == pytest.approx(2e-4 / (p * (1 - p) / 1000), rel=1e-6)
    assert found.degrees_of_freedom == 2
    assert found.p10_error[0] == pytest.approx(np.sqrt(p * (1 - p) / 2000), rel=1e-9)


@pytest.mark.parametrize(("ones_of_0", "ones_of_1"), [(0, 8192), (0, 400), (8000, 8192)])
def test_probabilities_at_the_extremes(ones_of_0: int, ones_of_1: int) -> None:
    found = fit_readout(*pair([ones_of_0], [ones_of_1]), SHOTS, np.array([0]))
    assert 0 <= found.p10[0] <= 1
    assert 0 <= found.p01[0] <= 1
    np.testing.assert_allclose(found.p10[0], ones_of_0 / SHOTS, atol=1e-6)
    np.testing.assert_allclose(1 - found.p01[0], ones_of_1 / SHOTS, atol=1e-6)
    assert found.p10_error[0] > 0  # no ones in N shots do not say that there never are


def test_no_contrast_is_refused() -> None:
    prepared, ones = pair([80, 4096], [8000, 4150])
    with pytest.raises(
        CalibrationError, match=r"readout of qubit 9 \(0\.0\d+\) preserves less than"
    ):
        fit_readout(prepared, ones, SHOTS, np.array([4, 9]))
    flat = SHOTS / 2 * (1 + 0.0055 * np.cos(ANGLES))[:, None]
    with pytest.raises(CalibrationError, match=r"response of qubit 6 \(0\.005\d\) preserves less"):
        fit_response(ANGLES, flat, SHOTS, np.array([6]))


def test_too_few_shots_are_refused_with_how_many_would_do() -> None:
    prepared, ones = pair([1, 2], [7, 8])
    with pytest.raises(CalibrationError, match="Too few shots: the readout of qubit 4") as caught:
        fit_readout(prepared, ones, 10, np.array([4, 9]))
    errors = [np.sqrt((k + 0.5) * (10.5 - k)) / 11 / np.sqrt(10) for k in (2, 8)]
    wanted = (np.hypot(*errors) / MAX_ERROR) ** 2
    assert f"Use at least {math.ceil(10 * wanted) / 10} times the shots" in str(caught.value)
    with pytest.raises(CalibrationError, match="Too few shots"):
        fit_response(ANGLES, np.round(5 * (1 - np.cos(ANGLES)))[:, None] / 2, 5, np.array([1]))


def test_a_bit_that_was_not_prepared_is_refused() -> None:
    with pytest.raises(CalibrationError, match="not prepared in both"):
        fit_readout(np.zeros((2, 1), dtype=int), np.zeros((2, 1)), 10, np.array([0]))


def curve(b: float, c: float, s: float, angles: np.ndarray = ANGLES) -> np.ndarray:
    return b + c * np.cos(angles) + s * np.sin(angles)


def test_exact_probabilities_give_the_curves_back() -> None:
    curves = np.array([[0.03, -0.92, 0.01], [0.0, 1.0, 0.0], [-0.1, -0.5, -0.4], [0.2, -0.8, 0.0]])
    ones = np.array([(1 - curve(*made)) / 2 for made in curves]).T
    found = fit_response(ANGLES, ones, None, np.arange(4))
    np.testing.assert_allclose(found.curves, curves, atol=1e-6)
    np.testing.assert_array_equal(found.covariance, 0)
    np.testing.assert_array_equal(found.chi_square, 0)


@pytest.mark.parametrize("angles", [ANGLES[:4], np.array([0.0, 2 * np.pi, 1.0, 1.0])])
def test_angles_that_do_not_fix_a_curve_are_refused(angles: np.ndarray) -> None:
    with pytest.raises(CalibrationError, match="do not determine a curve"):
        fit_response(angles, np.ones((4, 1)), SHOTS, np.array([0]))


def test_the_cone_holds_where_counts_would_leave_it() -> None:
    """Counts no state gives: between the angles <Z> leaves [-1, 1].

    Nelder-Mead minimises the same misfit, qubit by qubit.
    """
    z = np.stack([curve(0.0, -0.97, 0.35), curve(-0.02, -0.96, -0.36)], axis=1)
    ones = np.round((1 - z) / 2 * SHOTS)
    found = fit_response(ANGLES, ones, SHOTS, np.array([0, 1]))
    for qubit in range(2):
        p = (ones[:, qubit] + 0.5) / (SHOTS + 1)
        measured, spread = 1 - 2 * ones[:, qubit] / SHOTS, np.sqrt(4 * p * (1 - p) / SHOTS)

        def misfit(v: np.ndarray, measured=measured, spread=spread) -> float:
            return float((((curve(*v) - measured) / spread) ** 2).sum())

        free = np.linalg.lstsq(
            np.stack([np.ones(8), np.cos(ANGLES), np.sin(ANGLES)], 1) / spread[:, None],
            measured / spread,
            rcond=None,
        )[0]

        def within(v: np.ndarray) -> np.ndarray:
            """A curve in the cone from b, the share of 1 - |b| that is used, and a phase."""
            r = v[1] * (1 - abs(v[0]))
            return np.array([v[0], r * np.cos(v[2]), r * np.sin(v[2])])

        theirs = minimize(
            lambda v, misfit=misfit, within=within: misfit(within(v)),
            [free[0], 0.99, np.arctan2(free[2], free[1])],
            method="Nelder-Mead",
            bounds=[(-1, 1), (0, 1), (-7, 7)],
            options={"xatol": 1e-8, "fatol": 1e-8, "maxfev": 5000},
        )
        b, c, s = found.curves[qubit]
        assert abs(b) + np.hypot(c, s) == pytest.approx(1, abs=1e-6)  # the constraint is active
        np.testing.assert_allclose((b, c, s), within(theirs.x), atol=1e-5)
        assert misfit(np.array([b, c, s])) <= theirs.fun * (1 + 1e-5)
        assert abs(free[0]) + np.hypot(free[1], free[2]) > 1.005


def test_the_errors_are_the_scatter() -> None:
    """2,000 qubits alike, fitted in one problem, scatter as the fit says; the truth is the mean."""
    count, made = 2000, np.array([0.02, -0.93, 0.015])
    rng = np.random.default_rng(1)
    p_one = (1 - curve(*made)) / 2
    ones = rng.binomial(SHOTS, p_one[:, None], (len(ANGLES), count)).astype(float)
    found = fit_response(ANGLES, ones, SHOTS, np.arange(count))
    curves, covariance = np.array(found.curves), np.mean(found.covariance, axis=0)
    expected = np.sqrt(np.diag(covariance))
    # The deviation of 2,000 normal draws has a relative error of 1 / sqrt(4,000), a correlation one
    # of 1 / sqrt(2,000) at most; the mean is off by a deviation / sqrt(2,000), and by half a count.
    assert (np.abs(curves.std(axis=0) / expected - 1) < ONCE_IN_A_MILLION / np.sqrt(4000)).all()
    scaled = np.cov(curves.T) / np.outer(expected, expected)
    np.testing.assert_allclose(
        scaled, covariance / np.outer(expected, expected), atol=ONCE_IN_A_MILLION / np.sqrt(2000)
    )
    bias = np.abs(curves.mean(axis=0) - made)
    assert (bias < ONCE_IN_A_MILLION * expected / np.sqrt(count) + 1 / SHOTS).all()
    assert np.mean(found.chi_square) == pytest.approx(found.degrees_of_freedom, rel=0.1)


def test_readout_errors_are_the_scatter() -> None:
    count = 2000
    prepared = patterns(count)
    rng = np.random.default_rng(2)
    ones = rng.binomial(500, np.where(prepared == 1, 0.93, 0.02)).astype(float)
    found = fit_readout(prepared, ones, 500, np.arange(count))
    for values, errors, true in (
        (found.p10, found.p10_error, 0.02),
        (found.p01, found.p01_error, 0.07),
    ):
        said = np.sqrt(np.mean(np.square(errors)))
        assert np.std(values) / said == pytest.approx(1, abs=ONCE_IN_A_MILLION / np.sqrt(4000))
        assert abs(np.mean(values) - true) < ONCE_IN_A_MILLION * said / np.sqrt(count) + 1e-6
