"""Curves constrained to [-1, 1]: against scipy's optimiser, and the bound on their error."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from qcompile.device import IDEAL
from qcompile.errors import CalibrationError
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate, cone
from qcompile.mitigation.cone import within_cone
from qcompile.mitigation.fits import fit_response
from qcompile.mitigation.measure import LIVE_ANGLES_RAD

LEAST_GAP = 1e-3
Problem = tuple[np.ndarray, np.ndarray]


def problem(seed: int, shots: int, count: int = 8) -> Problem:
    """Free curves beyond the cone by up to four standard errors, and their information."""
    rng = np.random.default_rng(seed)
    phase, offset = rng.uniform(-np.pi, np.pi, count), rng.uniform(-0.3, 0.3, count)
    amplitude = 1 - np.abs(offset)
    design = np.stack([np.ones(6), np.cos(LIVE_ANGLES_RAD), np.sin(LIVE_ANGLES_RAD)], axis=1)
    curves = np.stack([offset, amplitude * np.cos(phase), amplitude * np.sin(phase)], axis=1)
    weights = shots / np.maximum(1 - (curves @ design.T) ** 2, 2 / shots)
    information = np.einsum("ki,nk,kj->nij", design, weights, design)
    errors = np.linalg.cholesky(np.linalg.inv(information))
    step = np.einsum("nij,nj->ni", errors, rng.normal(size=(count, 3)))
    outward = np.sign((np.abs(curves + step).sum(axis=1)) - np.abs(curves).sum(axis=1))
    return curves + 4 * rng.uniform(0, 1, (count, 1)) * outward[:, None] * step, information


def size(curves: np.ndarray) -> np.ndarray:
    return np.abs(curves[:, 0]) + np.hypot(curves[:, 1], curves[:, 2])


def misfit(curve: np.ndarray, free: np.ndarray, information: np.ndarray) -> float:
    return float((curve - free) @ information @ (curve - free))


def by_scipy(free: np.ndarray, information: np.ndarray) -> np.ndarray:
    """Nelder and Mead on the surface |b| + r = 1, from both signs of b."""

    def surface(v: np.ndarray) -> np.ndarray:
        r = 1 - min(abs(v[0]), 1)
        return np.array([np.clip(v[0], -1, 1), r * np.cos(v[1]), r * np.sin(v[1])])

    phase = np.arctan2(free[2], free[1])
    found = [
        minimize(
            lambda v: misfit(surface(v), free, information),
            [start, phase],
            method="Nelder-Mead",
            options={"xatol": 1e-11, "fatol": 1e-11, "maxfev": 4000},
        )
        for start in (free[0], abs(free[0]) / 2, -abs(free[0]) / 2)
    ]
    return surface(min(found, key=lambda f: f.fun).x)


@pytest.mark.parametrize("shots", [256, 1_000_000])
@pytest.mark.parametrize("solver", [0, 1])
def test_no_curve_in_the_cone_fits_better(
    monkeypatch: pytest.MonkeyPatch, shots: int, solver: int
) -> None:
    monkeypatch.setattr(cone, "_SOLVERS", (cone._SOLVERS[solver], cone._SOLVERS[1]))
    free, information = problem(shots, shots)
    curves, gaps = within_cone(free, information, LEAST_GAP)
    outside = size(free) > 1
    assert outside.sum() >= 3
    np.testing.assert_array_equal(curves[~outside], free[~outside])
    assert (size(curves) <= 1 + 1e-12).all()
    assert (gaps <= LEAST_GAP).all()
    for index in np.flatnonzero(outside):
        theirs = misfit(by_scipy(free[index], information[index]), free[index], information[index])
        ours = misfit(curves[index], free[index], information[index])
        assert ours == pytest.approx(theirs, abs=LEAST_GAP)


def test_the_gap_bounds_the_error() -> None:
    """Of curves of the surface that are not the best ones."""
    free, information = problem(3, 1024)
    best, _ = within_cone(free, information, LEAST_GAP)
    outside = size(free) > 1
    for turn in (1e-3, 1e-2):
        c, s = np.cos(turn), np.sin(turn)
        others = best @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        gaps = cone._gap(others, free, information)
        for i in np.flatnonzero(outside):
            above = misfit(others[i], free[i], information[i])
            above -= misfit(best[i], free[i], information[i])
            assert gaps[i] >= above - LEAST_GAP > -2 * LEAST_GAP


@pytest.mark.parametrize(
    ("shots", "ones"),
    [(4096, [4096, 0, 3477, 584, 617, 3483]), (256, [256, 0, 221, 40, 34, 224])],
)
def test_counts_that_a_solver_called_inaccurate_are_fitted(shots: int, ones: list[int]) -> None:
    fit = fit_response(LIVE_ANGLES_RAD, np.array(ones, float)[:, None], shots, np.array([0]))
    p = (np.array(ones) + 0.5) / (shots + 1)
    design = np.stack([np.ones(6), np.cos(LIVE_ANGLES_RAD), np.sin(LIVE_ANGLES_RAD)], axis=1)
    weights = shots / (4 * p * (1 - p))
    z = 1 - 2 * np.array(ones) / shots
    information = (design * weights[:, None]).T @ design
    free = np.linalg.solve(information, design.T @ (weights * z))
    assert size(free[None])[0] > 1
    np.testing.assert_allclose(fit.curves[0], by_scipy(free, information), atol=2e-5)


def test_no_calibration_of_perfect_qubits_is_lost() -> None:
    """480 in one problem, and four times 24 whose counts Clarabel once called inaccurate."""
    for seed, count in ((0, 480), (11, 24), (27, 24), (33, 24), (37, 24)):
        found = calibrate(
            OfflineExecutor(IDEAL, seed),
            np.arange(count),
            1024,
            parts=["response"],
            angles_rad=np.repeat(LIVE_ANGLES_RAD[:, None], count, axis=1),
        )
        assert found.unfitted == ()


def broken(*_: Any) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros((1, 3)), np.array([np.nan])


def test_a_curve_that_no_solver_finds_is_refused_and_its_counts_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cone, "_solve", broken)
    ones = np.array([256, 0, 221, 40, 34, 224], float)[:, None]
    with pytest.raises(CalibrationError, match="No solver finds the response curve of qubit 7"):
        fit_response(LIVE_ANGLES_RAD, ones, 256, np.array([7]))
    found = calibrate(OfflineExecutor(IDEAL, 1), np.array([0]), 64, angles_rad=LIVE_ANGLES_RAD)
    assert found.response is None
    assert found.response_counts is not None
    assert found.readout is not None
