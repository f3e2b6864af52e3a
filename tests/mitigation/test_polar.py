"""Response curves in the polar angle: their values and their covariance."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.calibration import ResponseFit
from qcompile.mitigation.polar import PolarCurves, polar_curves
from qcompile.native import RX, SX

CURVES = np.array([[0.05, 0.9, 0.1], [-0.02, -0.8, 0.3], [0.1, 0.7, -0.4], [0.0, -0.6, -0.2]])
"""b, c, s; of the second and the fourth 0 and 1 are swapped for sign 1."""


def polar(curves: np.ndarray, sign: float, covariance: np.ndarray) -> PolarCurves:
    fit = ResponseFit(
        curves=tuple(map(tuple, curves.tolist())),
        covariance=tuple(tuple(map(tuple, rows)) for rows in covariance.tolist()),
        chi_square=(0.0,) * len(curves),
        degrees_of_freedom=3,
    )
    return polar_curves(fit, RX if sign > 0 else SX)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_curve_is_the_measured_one(sign: float) -> None:
    """a = w for sign 1 and w + pi for -1; the tilt is within a quarter turn."""
    found = polar(CURVES, sign, np.zeros((4, 3, 3)))
    w = np.linspace(0, np.pi, 9)[:, None]
    a = w if sign > 0 else w + np.pi
    b, c, s = CURVES.T
    shown = found.offset + found.contrast * np.cos(w - found.tilt)
    np.testing.assert_allclose(shown, b + c * np.cos(a) + s * np.sin(a), atol=1e-14)
    assert (np.abs(found.tilt) <= np.pi / 2).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_covariance_is_that_of_curves_that_scatter(sign: float) -> None:
    """Moved by little, offset, contrast and tilt move with the covariance that is stated."""
    rng = np.random.default_rng(4)
    root = 1e-4 * rng.normal(size=(4, 3, 3))
    covariance = root @ root.transpose(0, 2, 1)
    found = polar(CURVES, sign, covariance)
    for qubit, curve in enumerate(CURVES):
        moved = curve + np.concatenate([root[qubit].T, -root[qubit].T])
        at = polar(moved, sign, np.zeros((6, 3, 3)))
        values = np.stack([at.offset, at.contrast, at.tilt], axis=1)
        steps = (values[:3] - values[3:]) / 2  # along each column of the root
        largest = np.abs(found.covariance[qubit]).max()
        np.testing.assert_allclose(
            found.covariance[qubit], steps.T @ steps, rtol=0, atol=1e-4 * largest
        )
