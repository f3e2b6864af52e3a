"""Large angles, against mpmath with 1,500 bits."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from qcompile.ir import Angle
from qcompile.ir.turns import MODERATE_RAD, reduced, reduced_product, reduced_sum

mpmath.mp.prec = 1500

NEAREST_TO_A_QUARTER = 6381956970095103 * 2.0**797
"""The double that comes closest to a multiple of pi/2 (Muller, Elementary Functions)."""


def exact(angle: float) -> mpmath.mpf:
    return mpmath.mpf(float(angle))


def off(found: float, wanted: mpmath.mpf) -> float:
    """How far two angles are apart, whole turns aside."""
    return float(2 * abs(mpmath.sin((exact(found) - wanted) / 2)))


def spread(seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, count) * 10.0 ** rng.uniform(-3, 308, count)


def test_reduced_is_exact_for_every_double():
    special = [0.0, -0.0, 3.9, 4.0, -4.0, 1e8, 1e22, 1e308, -1.7e308, NEAREST_TO_A_QUARTER]
    angles = np.array([*special, *spread(0, 500)])
    found = reduced(angles)
    assert max(map(off, found, map(exact, angles))) <= 1e-15
    assert np.abs(found).max() <= 4.0
    small = np.abs(angles) < 4
    np.testing.assert_array_equal(found[small], angles[small])
    np.testing.assert_array_equal(reduced(np.array([np.inf, np.nan])), [np.inf, np.nan])


def test_products_are_not_rounded_before_they_are_reduced():
    factors = np.random.default_rng(1).uniform(-3, 3, 500)
    values = spread(2, 500)
    found = reduced_product(factors, values)
    products = [exact(a) * exact(b) for a, b in zip(factors, values, strict=True)]
    assert max(map(off, found, products)) <= 2e-15
    assert np.isnan(reduced_product(np.array(10.0), np.array(1e308)))


def test_sums_are_exact():
    parts = [Fraction(1e300), Fraction(0.3), Fraction(-1e8), Fraction(1, 3)]
    wanted = exact(1e300) + exact(0.3) - exact(1e8) + mpmath.mpf(1) / 3
    assert off(reduced_sum(parts), wanted) <= 1e-15


@pytest.mark.parametrize("value", [1e8, -1e8, 300.0, 1e22, 1e308, -1.7e308])
def test_an_angle_wraps_exactly(value):
    assert off(Angle(value).wrapped().constant, exact(value)) <= 1e-15
    assert off(Angle(value).moderate().constant, exact(value)) <= 1e-15
    near = float(mpmath.fmod(exact(value), 2 * mpmath.pi))
    assert Angle(value).equals(near)
    assert not Angle(value).equals(near + 1e-9)
    assert Angle.of(str(Angle(value))) == Angle(value)


def test_a_moderate_angle_stays_as_it_is():
    assert Angle(MODERATE_RAD).moderate() == Angle(MODERATE_RAD)
    assert Angle.of("2*x0+7").substitute({"x0": 100.0}) == Angle(207.0)


def test_large_numbers_are_substituted_exactly():
    angle = Angle.of("0.3*x0-x1+0.25*x2+1").substitute({"x0": 1e9, "x1": 7e14})
    wanted = exact(0.3) * exact(1e9) - exact(7e14) + 1
    assert off(angle.constant, wanted) <= 2e-15
    assert angle.terms == (("x2", 0.25),)
    for value in (1.7e308, float("inf"), float("nan")):
        with pytest.raises(ValueError, match="not finite"):
            Angle.of("10*x0").substitute({"x0": value})


def test_large_terms_that_cancel_are_substituted_exactly():
    angle = Angle.of("0.1*x0-0.1*x1").substitute({"x0": 1e9 + 1, "x1": 1e9})
    assert off(angle.constant, exact(0.1)) <= 2e-15
