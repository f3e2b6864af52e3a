"""Angles: parsing, text, arithmetic, and what is refused."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qcompile.errors import CircuitError
from qcompile.ir import NEGLIGIBLE_RAD, Angle

numbers = st.one_of(
    st.floats(-1e6, 1e6),
    st.builds(lambda top, bottom: top * math.pi / bottom, st.integers(-40, 40), st.integers(1, 16)),
)
symbols = st.from_regex(r"(x|theta|_?[a-z]_)[0-9]{1,3}", fullmatch=True)
angles = st.builds(
    lambda number, terms: sum((Angle.symbol(s) * c for s, c in terms.items()), Angle.of(number)),
    numbers,
    st.dictionaries(symbols, numbers, max_size=4),
)


def at(angle: Angle, values: dict[str, float]) -> float:
    return angle.constant + sum(c * values[s] for s, c in angle.terms)


@given(angles)
def test_the_text_reads_back_as_the_same_angle(angle: Angle) -> None:
    assert Angle.of(str(angle)) == angle


@pytest.mark.parametrize(
    ("text", "constant", "terms"),
    [
        ("x0", 0.0, (("x0", 1.0),)),
        ("0.5*x1+theta2-1.57", -1.57, (("theta2", 1.0), ("x1", 0.5))),
        ("theta2 - pi/2", -math.pi / 2, (("theta2", 1.0),)),
        ("-(x0 - 2)", 2.0, (("x0", -1.0),)),
        ("x0*2/4", 0.0, (("x0", 0.5),)),
        ("2*(x0+x1)*3", 0.0, (("x0", 6.0), ("x1", 6.0))),
        ("x0-x0", 0.0, ()),
        ("+3", 3.0, ()),
        ("1e-3", 1e-3, ()),
        ("  pi ", math.pi, ()),
        ("3*pi/4", 3 * math.pi / 4, ()),
        ("0*x0", 0.0, ()),
    ],
)
def test_parsing(text: str, constant: float, terms: tuple[tuple[str, float], ...]) -> None:
    assert Angle.of(text) == Angle(constant, terms)


@pytest.mark.parametrize(
    ("angle", "text"),
    [
        (Angle(), "0.0"),
        (Angle(math.pi), "pi"),
        (Angle(-math.pi), "-pi"),
        (Angle(3 * math.pi / 4), "3*pi/4"),
        (Angle(0.1), "0.1"),
        (Angle.of("x1+x0"), "x0+x1"),
        (Angle.of("-x0-pi/2"), "-x0-pi/2"),
        (Angle.of("x0*-0.5+1"), "-0.5*x0+1.0"),
    ],
)
def test_the_text_form(angle: Angle, text: str) -> None:
    assert str(angle) == text


@pytest.mark.parametrize(
    "text",
    [
        "x0*x1", "x0**2", "1/x0", "sin(x0)", "__import__('os')", "x0.real", "x[0]", "lambda: 1",
        "x0 if 1 else 2", "", "  ", "(", "x0 x1", "'pi'", "1j", "x0; x1", "x0=1",
        "x0 @ x1", "1 < 2", "1/0", "x0/0", "~1", "not x0", "(1, 2)", "{}", "f'{x0}'",
        "(x:=1)", "\x00", "-" * 5000 + "1", "(" * 500 + "1" + ")" * 500,
    ],
)  # fmt: skip
def test_a_nonaffine_text_is_refused(text: str) -> None:
    with pytest.raises(CircuitError):
        Angle.of(text)


def test_the_refusal_names_the_text_and_an_example() -> None:
    with pytest.raises(CircuitError) as caught:
        Angle.of("x0*x1")
    assert str(caught.value) == (
        "'x0*x1' is not an affine angle.\n"
        "  An angle is a number, or a sum of number*symbol and numbers, like '0.5*x1+theta2-pi/2'."
    )


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "1e999", "1e999*x0"])
def test_an_infinite_angle_is_refused(value: float | str) -> None:
    with pytest.raises(CircuitError, match=r"not finite.\n  It contains (nan|-?inf)\.$"):
        Angle.of(value)


@pytest.mark.parametrize("value", [None, True, [], 1j, b"x0"])
def test_other_types_are_refused(value: object) -> None:
    with pytest.raises(CircuitError, match="is not an angle"):
        Angle.of(value)


@pytest.mark.parametrize("name", ["", "0x", "x 0", "x-0", "pi", "x0\n"])
def test_an_invalid_symbol_is_refused(name: str) -> None:
    with pytest.raises(CircuitError, match="is not a symbol"):
        Angle.symbol(name)


@given(angles, angles, st.floats(-10, 10))
def test_arithmetic_is_that_of_the_numbers(first: Angle, second: Angle, factor: float) -> None:
    values = dict.fromkeys({*first.symbols, *second.symbols}, 0.75)
    size = 1e-9 * (1 + abs(at(first, values)) + abs(at(second, values)))
    slack = 1e-6 + size + NEGLIGIBLE_RAD * 10
    assert at(first + second, values) == pytest.approx(
        at(first, values) + at(second, values), abs=slack
    )
    assert at(first - second, values) == pytest.approx(
        at(first, values) - at(second, values), abs=slack
    )
    assert at(first * factor, values) == pytest.approx(at(first, values) * factor, abs=slack * 10)
    assert at(-first, values) == -at(first, values)
    assert first - first == Angle()


@given(angles)
def test_terms_are_sorted_unique_and_never_zero(angle: Angle) -> None:
    assert list(angle.symbols) == sorted(set(angle.symbols))
    assert all(c != 0 for _, c in angle.terms)


@given(st.floats(-100, 100))
def test_wrapping_keeps_the_rotation(value: float) -> None:
    wrapped = Angle(value).wrapped().constant
    assert -math.pi < wrapped <= math.pi
    turns = (value - wrapped) / (2 * math.pi)
    assert turns == pytest.approx(round(turns), abs=1e-12)


@pytest.mark.parametrize(
    ("value", "target", "equal"),
    [
        (2 * math.pi, 0.0, True),
        (-math.pi, math.pi, True),
        (1e-14, 0.0, True),
        (1e-12, 0.0, False),
        (math.pi / 2, -math.pi / 2, False),
    ],
)
def test_equality_up_to_whole_turns(value: float, target: float, equal: bool) -> None:
    assert Angle(value).equals(target) is equal


def test_an_angle_with_symbols_equals_no_number() -> None:
    assert not Angle.symbol("x0").equals(0.0)


def test_substitution_binds_only_the_given_symbols() -> None:
    angle = Angle.of("2*x0+theta0+1")
    assert angle.substitute({"x0": 0.5, "other": 3.0}) == Angle.of("theta0+2")
    assert angle.substitute({"x0": 0.5, "theta0": -2.0}) == Angle()


def test_equal_angles_hash_alike_and_cannot_change() -> None:
    first, second = Angle.of("x0+2*x1"), Angle.of("2*x1+x0")
    assert first == second
    assert hash(first) == hash(second)
    assert first != Angle.of("x0+x1")
    with pytest.raises(dataclasses.FrozenInstanceError):
        first.constant = 1.0


@pytest.mark.parametrize("name", ["θ", "ϕ", "φ", "α", "lambda", "in", "None", "_1", "ℓ2"])
def test_any_name_may_be_a_symbol(name: str) -> None:
    angle = Angle.symbol(name) * 0.5 + 1.0
    assert angle == Angle.of(f"{name}/2+1")
    assert Angle.of(str(angle)) == angle
    assert angle.symbols == (name,)


def test_symbols_that_look_alike_stay_apart() -> None:
    assert Angle.of("ϕ-φ").symbols == ("φ", "ϕ")


def test_products_and_quotients_with_a_constant_angle() -> None:
    angle, half = Angle.of("3*x0-1.5"), Angle(0.5)
    assert angle * half == half * angle == Angle(-0.75, (("x0", 1.5),))
    assert angle / half == Angle(-3.0, (("x0", 6.0),))
    assert Angle(1.0) / 3 == Angle(1.0 / 3.0)


@pytest.mark.parametrize(
    ("operation", "text"),
    [(lambda a, b: a * b, "(x0)*(x1)"), (lambda a, b: Angle(1.0) / b, "(1.0)/(x1)")],
)
def test_a_product_or_quotient_that_is_not_affine_is_refused(operation: Any, text: str) -> None:
    with pytest.raises(CircuitError, match=re.escape(f"'{text}' is not an affine angle.")):
        operation(Angle.symbol("x0"), Angle.symbol("x1"))


def test_a_quotient_by_zero_is_refused() -> None:
    with pytest.raises(ZeroDivisionError):
        Angle.symbol("x0") / 0.0
