"""Symbolic angles that Python code can compute with, which records the angles of its gates."""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np

from qcompile.errors import CircuitError
from qcompile.interop.symbols import not_affine
from qcompile.ir import Angle
from qcompile.ir.products import product

_FUNCTIONS = (
    *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "sign", "square"),
    *("exp", "log", "sqrt", "floor", "ceil", "rint", "trunc"),
)


class TracedAngle:
    """An affine expression of inputs and parameters; numpy arrays hold it as an object.

    With `products` inputs and parameters can be multiplied: see `ir.products`.

    Raises:
        CircuitError: it is used where a number is needed, or in an expression that is not affine.
    """

    __slots__ = ("_products", "angle")

    def __init__(self, angle: Angle, products: bool = False):
        self.angle, self._products = angle, products

    def _like(self, angle: Angle) -> TracedAngle:
        return TracedAngle(angle, self._products)

    def __add__(self, other: Any) -> Any:
        value = _value(other)
        return NotImplemented if value is None else self._like(self.angle + value)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        value = _value(other)
        return NotImplemented if value is None else self._like(self.angle - value)

    def __rsub__(self, other: Any) -> Any:
        return -self + other

    def __mul__(self, other: Any) -> Any:
        value = _value(other)
        if value is None:
            return NotImplemented
        if self.angle.is_constant or value.is_constant:
            return self._like(self.angle * value)
        if not self._products:
            raise not_affine(f"({self.angle})*({value})")
        return self._like(product(self.angle, value))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        value = _value(other)
        if value is None:
            return NotImplemented
        if not value.is_constant:
            raise not_affine(f"({self.angle})/({value})")
        return self._like(self.angle / value)

    def __rtruediv__(self, other: Any) -> Any:
        raise not_affine(f"{other}/({self.angle})")

    def __pow__(self, exponent: Any) -> Any:
        if exponent == 1:
            return self
        raise not_affine(f"({self.angle})**{exponent}")

    def __mod__(self, other: Any) -> Any:
        raise not_affine(f"({self.angle}) % {other}")

    def __abs__(self) -> Any:
        raise not_affine(f"abs({self.angle})")

    def __neg__(self) -> TracedAngle:
        return self._like(-self.angle)

    def __pos__(self) -> TracedAngle:
        return self

    def _unknown(self, *_: Any) -> Any:
        raise CircuitError(
            f"The function uses the value of {self.angle}, which is not known yet.",
            "Only angles may depend on inputs and parameters, not the choice of gates.",
        )

    __float__ = __int__ = __complex__ = __bool__ = __index__ = _unknown
    __lt__ = __le__ = __gt__ = __ge__ = _unknown

    def __repr__(self) -> str:
        return str(self.angle)


def _refusal(function: str) -> Any:
    def refuse(self: TracedAngle, *_: Any) -> Any:
        raise not_affine(f"{function}({self.angle})")

    return refuse


for _function in _FUNCTIONS:  # the methods that numpy calls on objects
    setattr(TracedAngle, _function, _refusal(_function))


def _value(other: Any) -> Angle | None:
    """The operand of a computation as an angle; None if it is an array or not a number."""
    if isinstance(other, TracedAngle):
        return other.angle
    if getattr(other, "shape", None) == () and hasattr(other, "item"):
        other = other.item()
    if isinstance(other, TracedAngle):
        return other.angle
    return Angle.of(float(other)) if isinstance(other, Real) else None


def traced(name: str, shape: int | tuple[int, ...], products: bool = False) -> Any:
    """An array of `shape` of the symbols name0, name1, ... in C order; a single one for ()."""
    size = int(np.prod(shape, dtype=int))
    array = np.empty(size, dtype=object)
    array[:] = [TracedAngle(Angle.symbol(f"{name}{i}"), products) for i in range(size)]
    return array.reshape(shape) if shape != () else array[0]
