"""The curve in [-1, 1] closest to a fitted one, by cvxpy."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray

_ROUNDING = 1e-9
_SOLVERS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("CLARABEL", {}),
    ("SCS", {"eps": 1e-9, "max_iters": 20_000}),
)


def within_cone(
    free: FloatArray, information: FloatArray, most: float
) -> tuple[FloatArray, FloatArray]:
    """The curves (b, c, s) with the least misfit under |b| + sqrt(c^2 + s^2) <= 1, and their gaps.

    `free` (n, 3) are the minima without the constraint, `information` (n, 3, 3) the quadratic form
    of the misfit around them. A free curve within the cone is returned as it is; cvxpy solves for
    the others. The gap (n,) is an upper bound, in units of chi-square, on the misfit of a curve
    above the minimum. A curve whose gap is above `most`, or nan, is solved again by itself with a
    second solver.
    """
    size = _size(free)
    curves = free / np.maximum(size, 1.0)[:, None]
    gaps = np.zeros(len(free))
    open_ones = np.flatnonzero(size > 1.0 + _ROUNDING)
    if open_ones.size:
        curves[open_ones], gaps[open_ones] = _solve(
            free[open_ones], information[open_ones], *_SOLVERS[0]
        )
    for index in np.flatnonzero(~(gaps <= most)):
        at = slice(index, index + 1)
        curve, gap = _solve(free[at], information[at], *_SOLVERS[1])
        if not gaps[index] <= gap[0]:
            curves[at], gaps[at] = curve, gap
    return curves, gaps


def _size(curves: FloatArray) -> FloatArray:
    return np.asarray(np.abs(curves[:, 0]) + np.hypot(curves[:, 1], curves[:, 2]))


def _gap(curves: FloatArray, free: FloatArray, information: FloatArray) -> FloatArray:
    """How far the misfit may be above its minimum, by the duality gap of Frank and Wolfe.

    The misfit is convex, so its minimum over the cone is not below that of its linearisation, which
    lies at a vertex: the support function of the cone is max(|g_b|, |(g_c, g_s)|). The gap is 0
    where the conditions of Karush, Kuhn and Tucker hold.
    """
    slope = 2.0 * np.einsum("nij,nj->ni", information, curves - free)
    support = np.maximum(np.abs(slope[:, 0]), np.hypot(slope[:, 1], slope[:, 2]))
    return np.asarray((slope * curves).sum(axis=1) + support)


def _solve(
    free: FloatArray, information: FloatArray, solver: str, options: dict[str, Any]
) -> tuple[FloatArray, FloatArray]:
    """Curves in the cone, and their gaps; nan where the solver fails.

    The variables are steps in standard errors. The plane of c and s is rotated so that c is the
    amplitude of the free curve, which makes the cone (1 - |b| - c) (1 - |b| + c) >= s^2: near its
    surface the first factor is of the size of an error, and no digits cancel.
    """
    import cvxpy

    nothing = np.full(len(free), np.nan)
    amplitude = np.maximum(np.hypot(free[:, 1], free[:, 2]), _ROUNDING)
    cos, sin = free[:, 1] / amplitude, free[:, 2] / amplitude
    turn = np.zeros_like(information)
    turn[:, 0, 0] = 1.0
    turn[:, 1, 1], turn[:, 1, 2], turn[:, 2, 1], turn[:, 2, 2] = cos, sin, -sin, cos
    turned = turn @ information @ turn.transpose(0, 2, 1)
    errors = np.linalg.inv(np.linalg.cholesky(turned).transpose(0, 2, 1))  # upper triangles
    unit = np.sqrt((errors[:, :2] ** 2).sum(axis=(1, 2)))
    steps = cvxpy.Variable((3, len(free)))

    def moved(row: int, scale: FloatArray) -> Any:
        columns = range(row, 3)
        return sum(cvxpy.multiply(errors[:, row, k] / scale, steps[k]) for k in columns)

    one = np.ones(len(free))
    constraints = []
    for sign in (1.0, -1.0):
        offset = sign * free[:, 0]
        near = (1 - offset - amplitude) / unit - sign * moved(0, unit) - moved(1, unit)
        far = 1 - offset + amplitude - sign * moved(0, one) + moved(1, one)
        across = 2 * moved(2, np.sqrt(unit))
        constraints.append(cvxpy.SOC(near + far, cvxpy.vstack([across, near - far])))
    problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(steps)), constraints)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the gap says how good an inaccurate solution is
            problem.solve(solver=solver, **options)
    except cvxpy.error.SolverError:
        return free, nothing
    if steps.value is None or not np.isfinite(steps.value).all():
        return free, nothing
    curves = free + np.einsum("nji,njk,kn->ni", turn, errors, steps.value)
    curves /= np.maximum(_size(curves), 1.0)[:, None]
    return curves, _gap(curves, free, information)
