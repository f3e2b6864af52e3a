"""The classical types of OpenQASM 3: typed values and their conversions.

Source: the OpenQASM 3 specification, "Types and Casting" and "Classical instructions".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, SupportsFloat

import numpy as np

from qcompile.errors import CircuitError
from qcompile.ir import Angle

TypeKind = Literal["bool", "int", "uint", "float", "angle", "bit"]

MAX_BITS = 1024
"""The width of the widest type that a file may use."""

_MACHINE_BITS = 64
_ROUNDED: dict[int | None, Callable[[float], SupportsFloat]] = {16: np.float16, 32: np.float32}
_TURN = Fraction(math.tau)
"""A cast from a float to an angle is modulo float(2 pi), says the specification."""


@dataclass(frozen=True)
class Type:
    """A scalar type, or a register of bits (kind "bit" with a width).

    A width of None is the machine's: 64 bits. A scalar bit is a bool.
    """

    kind: TypeKind
    width: int | None = None

    @property
    def bits(self) -> int:
        return self.width or _MACHINE_BITS

    @property
    def is_whole(self) -> bool:
        return self.kind in ("int", "uint")

    @property
    def has_bits(self) -> bool:
        """Whether & | ^ ~ << >> apply: they need a known number of bits."""
        return self.kind == "angle" or (self.kind in ("bit", "uint") and self.width is not None)

    def __str__(self) -> str:
        return self.kind if self.width is None else f"{self.kind}[{self.width}]"


BOOL, INT, FLOAT = Type("bool"), Type("int"), Type("float")


@dataclass(frozen=True)
class Value:
    """A value of a type.

    A float is an Angle, which may be affine in the inputs. Everything else is an int: a bool is 0
    or 1; an angle[n] of k is 2 pi k / 2^n radians.
    """

    type: Type
    number: int | Angle

    @classmethod
    def real(cls, number: float) -> Value:
        return cls(FLOAT, Angle.of(number))

    @property
    def whole(self) -> int:
        """The int that represents the value."""
        assert isinstance(self.number, int)
        return self.number

    @property
    def radians(self) -> Angle:
        """The value as a real number; for an angle in [0, 2 pi)."""
        if isinstance(self.number, Angle):
            return self.number
        if self.type.kind == "angle":
            return Angle(math.tau * (self.number / (1 << self.type.bits)))
        return Angle.of(self.number)

    def to(self, target: Type, *, cast: bool = False) -> Value:
        """The value converted to `target`; `cast` if the file has an explicit cast.

        A uint[n] and an angle[n] wrap. An int[n] wraps in a cast from a whole number, and from a
        uint[n]; otherwise a value that does not fit is refused, because compilers disagree on it.

        Raises:
            CircuitError: there is no such conversion, or the value does not fit.
        """
        kind = self.type.kind
        if kind == target.kind == "bit" and self.type != target:
            raise self._not(target, "The number of bits must be the same.")
        match target.kind:
            case "bool":
                if self._depends_on_inputs:
                    raise self._not(target)
                return Value(target, int(self.number not in (0, Angle())))
            case "int" | "uint":
                return Value(target, self._to_whole(target, cast))
            case "float":
                if kind == "bit":
                    raise self._not(target)
                return Value(target, rounded(self.radians, target))
            case "angle":
                return Value(target, self._to_turns(target))
        if kind == "float" or (kind != "bool" and self.type.width != target.width):
            raise self._not(target, "The number of bits must be the same.")
        return Value(target, self.whole % (1 << target.bits))

    @property
    def _depends_on_inputs(self) -> bool:
        return isinstance(self.number, Angle) and not self.number.is_constant

    def _to_whole(self, target: Type, cast: bool) -> int:
        number = self.number
        if self.type.kind == "angle" or self._depends_on_inputs:
            raise self._not(target)
        if self.type.kind == "bit" and self.type.width != target.width:
            raise self._not(target, "The number of bits must be the same.")
        if isinstance(number, Angle):
            if not (cast or number.constant.is_integer()):
                raise self._not(target, f"Write {target}(...) to truncate it.")
            number = int(number.constant)
        bits = target.bits
        low, high = (-1 << bits - 1, 1 << bits - 1) if target.kind == "int" else (0, 1 << bits)
        if low <= number < high:
            return number
        same_bits = self.type.kind in ("uint", "bit") and self.type.width == target.width
        wraps = target.width is not None and self.type.kind != "float"
        if not (wraps and (target.kind == "uint" or cast or same_bits)):
            text = number if number.bit_length() <= 128 else f"{number.bit_length()} bits"
            raise CircuitError(f"{text} does not fit {target}.", "Give it a wider type.")
        return (number - low) % (1 << bits) + low

    def _to_turns(self, target: Type) -> int:
        whole = 1 << target.bits
        if self._depends_on_inputs:
            raise CircuitError(
                "An angle variable cannot depend on an input: it would have to wrap.",
                "Declare it as float.",
            )
        if self.type.kind == "bit":
            if self.type.width != target.width:
                raise self._not(target, "The number of bits must be the same.")
            return self.whole
        if self.type.kind == "angle":
            return round(Fraction(self.whole * whole, 1 << self.type.bits)) % whole
        return round(Fraction(self.radians.constant) / _TURN * whole) % whole

    def _not(self, target: Type, *hints: str) -> CircuitError:
        return CircuitError(f"A value of type {self.type} cannot become {target}.", *hints)


def rounded(number: Angle, target: Type) -> Angle:
    """`number` rounded to a float type, unless it depends on an input."""
    if target.width not in _ROUNDED or not number.is_constant:
        return number
    with np.errstate(over="ignore"):
        return Angle.of(float(_ROUNDED[target.width](number.constant)))
