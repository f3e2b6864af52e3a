"""Expressions of a program file: affine angles and whole numbers."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Callable, MutableMapping, Set
from dataclasses import dataclass
from typing import Any

import openqasm3
from openqasm3 import ast

from qcompile.catalogue import nearest
from qcompile.errors import CircuitError
from qcompile.ir import Angle

CONSTANTS = {
    name: Angle(value)
    for names, value in (("pi π", math.pi), ("tau τ", math.tau), ("euler ℇ", math.e))
    for name in names.split()
}

_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "exp": math.exp,
    "ln": math.log,
    "log": math.log,
    "sqrt": math.sqrt,
    "arcsin": math.asin,
    "arccos": math.acos,
    "arctan": math.atan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
}

_SHOWN_CHARACTERS = 60


def shown(node: Any) -> str:
    """A node as one short line of source, for messages."""
    lines = openqasm3.dumps(node).strip().splitlines() or [""]
    text = (
        lines[min(len(getattr(node, "annotations", ())), len(lines) - 1)]
        .rstrip("; ")
        .removesuffix(" {")
    )
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."


@dataclass(frozen=True)
class Scope:
    """The names an expression may use.

    `whole` holds those that stand for integers; it is None in OpenQASM 2, whose numbers are real.
    """

    values: MutableMapping[str, Angle]
    whole: Set[str] | None

    def inner(self, values: MutableMapping[str, Angle]) -> Scope:
        """The scope of a gate's body, where `values` hide names of the file."""
        whole = self.whole and self.whole - values.keys()
        return Scope(ChainMap(values, self.values), whole)

    def evaluate(self, node: Any) -> Angle:
        """The affine angle an expression stands for.

        Raises:
            CircuitError: a name is unknown, or the value is not affine or not finite.
        """
        try:
            return self._affine(node)
        except ZeroDivisionError as error:
            raise CircuitError(f"{shown(node)!r} divides by zero.") from error
        except (OverflowError, ValueError) as error:
            if isinstance(error, CircuitError):
                raise
            raise CircuitError(f"{shown(node)!r} is no finite real number.") from error

    def whole_number(self, node: Any) -> int:
        """The integer a constant expression stands for.

        Raises:
            CircuitError: it is no constant integer.
        """
        angle = self.evaluate(node)
        if not (angle.is_constant and angle.constant.is_integer()):
            raise CircuitError(f"{shown(node)!r} is no constant whole number.")
        return int(angle.constant)

    def _affine(self, node: Any) -> Angle:
        match node:
            case ast.IntegerLiteral() | ast.FloatLiteral():
                return Angle.of(float(node.value))
            case ast.Identifier():
                if node.name not in self.values:
                    names = [name for name in self.values if name.isascii()]
                    raise CircuitError(f"Unknown name {node.name!r}.", nearest(node.name, names))
                return self.values[node.name]
            case ast.UnaryExpression() if node.op.name == "-":
                return -self._affine(node.expression)
            case ast.FunctionCall() if node.name.name in _FUNCTIONS and len(node.arguments) == 1:
                argument = self._affine(node.arguments[0])
                if argument.is_constant:
                    return Angle.of(_FUNCTIONS[node.name.name](argument.constant))
            case ast.BinaryExpression():
                return self._binary(node)
        raise _not_affine(node)

    def _binary(self, node: Any) -> Angle:
        left, right = self._affine(node.lhs), self._affine(node.rhs)
        match node.op.name:
            case "+":
                return left + right
            case "-":
                return left - right
            case "*" if right.is_constant:
                return left * right.constant
            case "*" if left.is_constant:
                return right * left.constant
            case "/" if right.is_constant:
                self._refuse_rounding(node, left.constant / right.constant)
                return sum(
                    (Angle.symbol(symbol) * (c / right.constant) for symbol, c in left.terms),
                    Angle.of(left.constant / right.constant),
                )
            case "**" if left.is_constant and right.is_constant:
                return Angle.of(math.pow(left.constant, right.constant))
            case "^":
                raise CircuitError(
                    f"{shown(node)!r} is an exclusive or in OpenQASM 3.", "Write ** for a power."
                )
        raise _not_affine(node)

    def _refuse_rounding(self, node: Any, quotient: float) -> None:
        """Raise CircuitError where readers differ: 1/2 is 0 to the standard, 0.5 to many."""
        if not quotient.is_integer() and self._is_whole(node):
            raise CircuitError(
                f"{shown(node)!r} divides whole numbers, which OpenQASM 3 rounds towards zero.",
                "Write one of them with a point, such as 1.0/2.",
            )

    def _is_whole(self, node: Any) -> bool:
        match node:
            case ast.IntegerLiteral():
                return self.whole is not None
            case ast.Identifier():
                return self.whole is not None and node.name in self.whole
            case ast.UnaryExpression():
                return self._is_whole(node.expression)
            case ast.BinaryExpression():
                return self._is_whole(node.lhs) and self._is_whole(node.rhs)
        return False


def _not_affine(node: Any) -> CircuitError:
    return CircuitError(
        f"{shown(node)!r} is no affine angle.",
        "An angle is a number, or a sum of number*input and numbers, like 0.5*x1+theta2-pi/2.",
    )
