"""Angles: affine expressions in named symbols, in radians."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from qcompile.errors import CircuitError
from qcompile.ir.affine import Affine, NotAffineError, add_terms, affine, divide, multiply
from qcompile.ir.turns import MODERATE_RAD, reduced, reduced_sum

NEGLIGIBLE_RAD = 1e-13
"""An angle this close to a special value counts as that value: `<Z>` moves by less than 1e-12."""

_PARTS_OF_PI = 48
_SYMBOL = re.compile(r"[^\W\d]\w*\Z")


@dataclass(frozen=True, slots=True)
class Angle:
    """constant + sum of coefficient * symbol, in radians.

    `terms` is sorted by symbol, with each symbol once and no zero coefficient. `Angle.of` and
    arithmetic guarantee that.
    """

    constant: float = 0.0
    terms: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of(cls, value: Angle | float | int | str) -> Angle:
        """The angle given as a number, a text such as "0.5*x1+theta2-pi/2", or an Angle.

        Raises:
            CircuitError: the text is not affine, or a number is not finite.
        """
        if isinstance(value, Angle):
            return value
        if isinstance(value, str):
            return _parse(value)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise CircuitError(
                f"{value!r} is not an angle.",
                "An angle is a number or an affine expression like 'x0+0.5'.",
            )
        try:
            return cls._checked(float(value), {})
        except OverflowError as error:
            raise CircuitError("An angle is not finite.", "Found a huge integer.") from error

    @classmethod
    def symbol(cls, name: str) -> Angle:
        """The angle `1 * name`."""
        check_symbol(name)
        return cls(0.0, ((name, 1.0),))

    @classmethod
    def _checked(cls, constant: float, terms: Mapping[str, float]) -> Angle:
        if not terms and math.isfinite(constant):
            return cls(constant)
        for value in (constant, *terms.values()):
            if not math.isfinite(value):
                raise CircuitError("An angle is not finite.", f"It contains {value}.")
        return cls(constant, tuple(sorted((s, c) for s, c in terms.items() if c)))

    @property
    def _affine(self) -> Affine:
        return self.constant, dict(self.terms)

    @property
    def is_constant(self) -> bool:
        return not self.terms

    @property
    def symbols(self) -> tuple[str, ...]:
        return tuple(symbol for symbol, _ in self.terms)

    def __add__(self, other: Angle | float) -> Angle:
        other = Angle.of(other)
        terms = dict(self.terms)
        add_terms(terms, other.terms, 1.0)
        return Angle._checked(self.constant + other.constant, terms)

    def __mul__(self, factor: Angle | float) -> Angle:
        """The product of two angles, one of which must be constant."""
        factor = Angle.of(factor)
        try:
            return Angle._checked(*multiply(self._affine, factor._affine))
        except NotAffineError as error:
            raise _not_affine(f"({self})*({factor})") from error

    def __truediv__(self, divisor: Angle | float) -> Angle:
        """The quotient of two angles, the divisor of which must be constant."""
        divisor = Angle.of(divisor)
        try:
            return Angle._checked(*divide(self._affine, divisor._affine))
        except NotAffineError as error:
            raise _not_affine(f"({self})/({divisor})") from error

    def __neg__(self) -> Angle:
        return self * -1.0

    def __sub__(self, other: Angle | float) -> Angle:
        return self + -Angle.of(other)

    def wrapped(self) -> Angle:
        """The same rotation, up to global phase, with its constant in (-pi, pi]."""
        constant = _within_a_turn(self.constant)
        if constant <= -math.pi + NEGLIGIBLE_RAD:
            constant += 2 * math.pi
        if constant > math.pi:
            constant = math.pi
        return Angle(constant, self.terms)

    def equals(self, constant: float) -> bool:
        """Whether it has no symbols and is `constant`, up to whole turns and NEGLIGIBLE_RAD."""
        distance = math.remainder(self.moderate().constant - constant, 2 * math.pi)
        return self.is_constant and abs(distance) <= NEGLIGIBLE_RAD

    def moderate(self) -> Angle:
        """The same rotation with a constant small enough to be added to others without loss.

        A constant above MODERATE_RAD is wrapped, exactly; a smaller one is unchanged.
        """
        return self if abs(self.constant) <= MODERATE_RAD else self.wrapped()

    def substitute(self, values: Mapping[str, float]) -> Angle:
        """The angle with the symbols in `values` replaced by their numbers.

        A constant that becomes larger than MODERATE_RAD is reduced modulo 2 pi, exactly.
        """
        products = [c * values[s] for s, c in self.terms if s in values]
        constant = self.constant + sum(products)
        if products and not sum(map(abs, products), abs(self.constant)) <= MODERATE_RAD:
            try:
                terms = [
                    Fraction(c) * Fraction(float(values[s])) for s, c in self.terms if s in values
                ]
                constant = reduced_sum([Fraction(self.constant), *terms])
            except (OverflowError, ValueError) as error:
                raise CircuitError(f"{self} is not finite at these values.") from error
        return Angle._checked(constant, {s: c for s, c in self.terms if s not in values})

    def rename(self, names: Mapping[str, str]) -> Angle:
        """The angle with its symbols renamed according to `names`."""
        return Angle._checked(self.constant, {names.get(s, s): c for s, c in self.terms})

    def __str__(self) -> str:
        parts = [_term(coefficient, symbol) for symbol, coefficient in self.terms]
        if self.constant or not parts:
            parts.append(_number(self.constant))
        return "+".join(parts).replace("+-", "-")


def _within_a_turn(angle: float) -> float:
    """`angle` modulo 2 pi, in [-pi, pi]."""
    if abs(angle) <= MODERATE_RAD:
        return math.remainder(angle, 2 * math.pi)
    return float(reduced(angle))


def check_symbol(name: str) -> None:
    """Raise CircuitError unless `name` can be the name of a symbol."""
    if not _SYMBOL.match(name) or name == "pi":
        raise CircuitError(
            f"{name!r} is not a symbol.",
            "A symbol consists of letters, digits and _, and is not 'pi'.",
        )


def _term(coefficient: float, symbol: str) -> str:
    if coefficient == 1.0:
        return symbol
    return f"-{symbol}" if coefficient == -1.0 else f"{coefficient!r}*{symbol}"


def _number(value: float) -> str:
    """`value` as a short text that parses back to the same float: a fraction of pi if it is one."""
    scaled = value * _PARTS_OF_PI / math.pi
    if math.isinf(scaled):
        return repr(float(value))
    parts = round(scaled)
    common = math.gcd(parts, _PARTS_OF_PI)
    top, bottom = parts // common, _PARTS_OF_PI // common
    if top and top * math.pi / bottom == value:
        text = {1: "pi", -1: "-pi"}.get(top, f"{top}*pi")
        return text if bottom == 1 else f"{text}/{bottom}"
    return repr(float(value))


def _parse(text: str) -> Angle:
    try:
        return Angle._checked(*affine(text))
    except (NotAffineError, RecursionError, ZeroDivisionError) as error:
        raise _not_affine(text) from error


def _not_affine(text: str) -> CircuitError:
    return CircuitError(
        f"{text[:80]!r} is not an affine angle.",
        "An angle is a number, or a sum of number*symbol and numbers, like '0.5*x1+theta2-pi/2'.",
    )
