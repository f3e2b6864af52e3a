"""Fitting counts: constrained least squares, weighted by shot noise."""

from __future__ import annotations

from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.calibration import ReadoutFit, ResponseFit, fit_problems
from qcompile.errors import CalibrationError
from qcompile.mitigation.cone import within_cone
from qcompile.validation import listed

_MIN_SPREAD = 1e-3  # of the angles: below it one of b, c and s is hardly measured
PRIOR_SHOTS = 8.0
"""The weight, in shots, of the mean readout of all qubits in the fit of one qubit."""

_MAX_GAP = 1e-3
"""In units of chi-square: a fit within 0.03 standard errors of the best one is accepted."""
_EXACT = 1e8
"""The variance of exact probabilities: they are assumed to be known to 1e-4 of `<Z>`."""


def fit_readout(
    prepared: IntArray, ones: FloatArray, shots: int | None, qubits: IntArray
) -> ReadoutFit:
    """The assignment matrices of `qubits`, fitted to their ones (patterns, n).

    `prepared` (patterns, n) holds the bit each qubit was prepared in. The frequencies of a qubit
    and a bit are averaged over patterns, which averages over crosstalk, and pulled towards the mean
    of all qubits with the weight of PRIOR_SHOTS. The least-squares solution is a mean of
    frequencies and so a probability. If `shots` is None, `ones` are exact probabilities.

    Raises:
        CalibrationError: a qubit hardly distinguishes |0> and |1>, or too few shots show it.
    """
    frequency = ones / (shots or 1)
    trials = np.stack([(prepared == bit).sum(axis=0) for bit in (0, 1)])  # (2, n)
    if not trials.all():
        raise CalibrationError("A qubit was not prepared in both |0> and |1>.")
    mean = np.stack([(frequency * (prepared == bit)).sum(axis=0) for bit in (0, 1)]) / trials
    common = mean.mean(axis=1, keepdims=True)
    total = trials * float(shots or 1)
    prior = PRIOR_SHOTS if shots is not None and len(qubits) > 1 else 0.0
    noise = _variance(mean, total)
    # Shot noise weights both terms of an entry equally, and entries share no term: it cancels.
    fitted = np.clip((total * mean + prior * common) / (total + prior), 0.0, 1.0)  # of rounding
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
    """The curves b + c cos(a) + s sin(a) of the measured `<Z>`, fitted to ones (circuits, n).

    `angles_rad` is (circuits, n), or (circuits,) if all `qubits` had the same angles. The fit is by
    least squares weighted by shot noise, under |b| + sqrt(c^2 + s^2) <= 1: `<Z>` stays in [-1, 1]
    at every angle (a second-order cone). The covariance is that of the unconstrained fit. If
    `shots` is None, `ones` are exact probabilities.

    Raises:
        CalibrationError: the angles do not determine a curve, a curve is flat, there are too few
            shots, or no solver finds the curve.
    """
    angles = angles_rad if angles_rad.ndim == 2 else np.repeat(angles_rad[:, None], len(qubits), 1)
    design = np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)], axis=2)
    if (np.linalg.matrix_rank(design.transpose(1, 0, 2), tol=_MIN_SPREAD) < 3).any():
        raise CalibrationError(
            f"{len(angles)} angles do not determine a curve.", "Use at least three different ones."
        )
    frequency = ones / (shots or 1)
    z = 1.0 - 2.0 * frequency
    weights = (shots or 1) / (4.0 * _variance(frequency, shots or 1.0))  # 1 / variance of z
    if shots is None:
        weights = np.full_like(weights, _EXACT)
    information = np.einsum("kni,kn,knj->nij", design, weights, design)
    covariance = np.linalg.inv(information)
    free = np.einsum("nij,knj,kn,kn->ni", covariance, design, weights, z)
    fitted, gaps = within_cone(free, information, _MAX_GAP)
    if lost := qubits[~(gaps <= _MAX_GAP)].tolist():
        raise CalibrationError(
            f"No solver finds the response curve of qubit {listed(list(map(str, lost)))}.",
            "Fit the other qubits with `qcompile calibrate --from FILE --qubits ...`.",
        )
    if shots is None:
        covariance = np.zeros_like(covariance)
    residual = np.einsum("kni,ni->kn", design, fitted) - z
    chi_square = (weights * residual**2).sum(axis=0) if shots else np.zeros(len(qubits))
    fit = ResponseFit(
        curves=_nested(fitted),
        covariance=_nested(covariance),
        chi_square=tuple(chi_square.tolist()),
        degrees_of_freedom=len(angles) - 3,
    )
    _check(fit, qubits)
    return fit


def _nested(array: FloatArray) -> Any:
    """The numbers of an array as nested tuples."""
    return _tuples(array.tolist())


def _tuples(values: Any) -> Any:
    return tuple(map(_tuples, values)) if isinstance(values, list) else values


def _variance(frequency: FloatArray, shots: FloatArray | float) -> FloatArray:
    """The variance p (1 - p), with half a count added to ones and zeros so that it is never 0."""
    p = (frequency * shots + 0.5) / (np.asarray(shots) + 1.0)
    return np.asarray(p * (1.0 - p))


def _check(fit: ReadoutFit | ResponseFit, qubits: IntArray) -> None:
    if words := fit_problems(fit, qubits.tolist()):
        raise CalibrationError(*words)
