"""Fits of counts with cvxpy: constrained least squares, weighted by shot noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.calibration import ReadoutFit, ResponseFit, weakness
from qcompile.errors import CalibrationError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

_LEAST_SPREAD = 1e-3  # of the angles: else one of b, c and s is hardly measured
PRIOR_SHOTS = 8.0
"""What all qubits together say of a qubit's readout weighs as much as so many shots of its own."""

# The solver ends at a misfit within 1e-8 of the least; a value at a constraint is then off by the
# root of that. In these units it is 1e-6.
_MISFIT_SCALE = 1e4


def fit_readout(
    prepared: IntArray, ones: FloatArray, shots: int | None, qubits: IntArray
) -> ReadoutFit:
    """Assignment matrices whose columns are distributions, from ones (patterns, n) of `qubits`.

    `prepared` (patterns, n) holds the bit each qubit was prepared in. The frequencies of a qubit
    and a bit are averaged over its patterns, so that crosstalk averages in, and drawn to the mean
    of all qubits with the weight of PRIOR_SHOTS; the least squares are weighted by shot noise.
    Without shots `ones` are exact probabilities.

    Raises:
        CalibrationError: a qubit tells |0> and |1> apart too little, or too few shots say so.
    """
    import cvxpy

    frequency = ones / (shots or 1)
    trials = np.stack([(prepared == bit).sum(axis=0) for bit in (0, 1)])  # (2, n)
    if not trials.all():
        raise CalibrationError("A qubit was not prepared in both |0> and |1>.")
    mean = np.stack([(frequency * (prepared == bit)).sum(axis=0) for bit in (0, 1)]) / trials
    common = mean.mean(axis=1, keepdims=True)
    total = trials * float(shots or 1)
    prior = PRIOR_SHOTS if shots is not None and len(qubits) > 1 else 0.0
    noise = _variance(mean, total)
    p_one = cvxpy.Variable(mean.shape)
    # The shot noise of an entry weighs its two terms alike, and entries share no term: it cancels.
    belief = cvxpy.sum(cvxpy.multiply(prior / total, cvxpy.square(p_one - common)))
    _solve(cvxpy, cvxpy.sum_squares(p_one - mean) + belief, [p_one >= 0, p_one <= 1])
    fitted = np.clip(p_one.value, 0.0, 1.0)
    errors = np.sqrt(noise / total) if shots is not None else np.zeros_like(mean)
    expected, variance = (np.where(prepared == 1, of[1], of[0]) for of in (mean, noise))
    chi_square = (shots or 0) * ((frequency - expected) ** 2 / variance).sum(axis=0)
    fit = ReadoutFit(
        p10=tuple(fitted[0].tolist()),
        p01=tuple((1.0 - fitted[1]).tolist()),
        p10_error=tuple(errors[0].tolist()),
        p01_error=tuple(errors[1].tolist()),
        chi_square=tuple(chi_square.tolist()),
        degrees_of_freedom=len(prepared) - 2,
    )
    _check(fit, qubits)
    return fit


def fit_response(
    angles_rad: FloatArray, ones: FloatArray, shots: int | None, qubits: IntArray
) -> ResponseFit:
    """Curves b + c cos(a) + s sin(a) of the measured <Z>, from ones (angles, n) of `qubits`.

    Least squares weighted by shot noise, under |b| + sqrt(c^2 + s^2) <= 1: <Z> stays in [-1, 1] at
    every angle (a second-order cone). The covariance is that of the unconstrained fit. Without
    shots `ones` are exact probabilities.

    Raises:
        CalibrationError: fewer than three angles, a curve that is flat, or too few shots.
    """
    import cvxpy

    design = np.stack([np.ones_like(angles_rad), np.cos(angles_rad), np.sin(angles_rad)], axis=1)
    if np.linalg.matrix_rank(design, tol=_LEAST_SPREAD) < 3:
        raise CalibrationError(
            f"{len(angles_rad)} angles do not fix a curve.", "It needs three that differ."
        )
    frequency = ones / (shots or 1)
    z = 1.0 - 2.0 * frequency
    weights = (shots or 1) / (4.0 * _variance(frequency, shots or 1.0))  # 1 / variance of z
    if shots is None:
        weights = np.ones_like(weights)
    covariance = np.linalg.inv(np.einsum("ki,kn,kj->nij", design, weights, design))
    free = np.einsum("nij,kj,kn,kn->in", covariance, design, weights, z)
    # What is sought is how far the constraint moves the curves: the misfit beyond the least is
    # small and solved to more digits. The qubits share no term, so each may scale its own.
    move = cvxpy.Variable(free.shape)
    curves, scaled = free + move, weights / weights.max(axis=0)
    misfit = cvxpy.sum(cvxpy.multiply(scaled, cvxpy.square(design @ move)))
    amplitude = cvxpy.norm(curves[1:], axis=0)
    _solve(cvxpy, misfit, [cvxpy.abs(curves[0]) + amplitude <= 1])
    fitted = curves.value.T
    if shots is None:
        covariance = np.zeros_like(covariance)
    residual = design @ fitted.T - z
    chi_square = (weights * residual**2).sum(axis=0) if shots else np.zeros(len(qubits))
    fit = ResponseFit(
        curves=_nested(fitted),
        covariance=_nested(covariance),
        chi_square=tuple(chi_square.tolist()),
        degrees_of_freedom=len(angles_rad) - 3,
    )
    _check(fit, qubits)
    return fit


def _nested(array: FloatArray) -> Any:
    """The numbers of an array in tuples of tuples."""
    return _tuples(array.tolist())


def _tuples(values: Any) -> Any:
    return tuple(map(_tuples, values)) if isinstance(values, list) else values


def _variance(frequency: FloatArray, shots: FloatArray | float) -> FloatArray:
    """p (1 - p) with half a count added to ones and zeros: never 0."""
    p = (frequency * shots + 0.5) / (np.asarray(shots) + 1.0)
    return np.asarray(p * (1.0 - p))


def _solve(cvxpy: Any, objective: Any, constraints: list[Any]) -> None:
    problem = cvxpy.Problem(cvxpy.Minimize(_MISFIT_SCALE * objective), constraints)
    problem.solve(solver=cvxpy.CLARABEL)
    if problem.status != "optimal":
        raise CalibrationError(f"The fit ended with status {problem.status!r}.")


def _check(fit: ReadoutFit | ResponseFit, qubits: IntArray) -> None:
    if words := weakness(fit, qubits.tolist()):
        raise CalibrationError(*words)
