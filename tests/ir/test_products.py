"""Products of symbols: expanded by hand, and renamed to distinct symbols."""

from __future__ import annotations

import pytest

from qcompile.errors import CircuitError
from qcompile.ir import Angle, Circuit, Gate
from qcompile.ir.products import product, separated


def test_a_product_is_expanded() -> None:
    """(2x + 1)(3s - x - 0.5) = 6sx - 2xx + 3s - 2x - 0.5."""
    expanded = product(Angle.of("2*x+1"), Angle.of("3*s-x-0.5"))
    assert expanded.constant == -0.5
    assert dict(expanded.terms) == {"s*x": 6.0, "x*x": -2.0, "s": 3.0, "x": -2.0}


def test_a_product_with_a_number_is_affine() -> None:
    assert product(Angle.of("2*x+1"), Angle.of(-0.5)) == Angle.of("-x-0.5")


def test_a_product_of_three_symbols_is_refused() -> None:
    with pytest.raises(CircuitError, match="product of three symbols"):
        product(product(Angle.of("a"), Angle.of("x")), Angle.of("a"))


def test_products_get_names_that_are_free() -> None:
    angle = product(Angle.of("a"), Angle.of("x")) + Angle.of("a_x")
    circuits, pairs = separated([Circuit((Gate("ry", angle),))], ["a", "x", "a_x"])
    assert str(circuits[0]) == "ry(a_x+a_x_)"
    assert pairs == {"a_x_": ("a", "x")}
    assert separated([Circuit.parse("ry(x)")], ["x"]) == ((Circuit.parse("ry(x)"),), {})
