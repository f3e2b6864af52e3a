"""Expressions of a program file: affine angles and whole numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
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
    text = lines[min(len(getattr(node, "annotations", ())), len(lines) - 1)].rstrip("; {")
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."


def evaluate(node: Any, values: Mapping[str, Angle]) -> Angle:
    """The affine angle an expression stands for; `values` holds its names.

    Raises:
        CircuitError: a name is unknown, or the value is not affine or not finite.
    """
    try:
        return _affine(node, values)
    except ZeroDivisionError as error:
        raise CircuitError(f"{shown(node)!r} divides by zero.") from error
    except (OverflowError, ValueError) as error:
        if isinstance(error, CircuitError):
            raise
        raise CircuitError(f"{shown(node)!r} is no finite real number.") from error


def whole_number(node: Any, values: Mapping[str, Angle]) -> int:
    """The integer a constant expression stands for.

    Raises:
        CircuitError: it is no constant integer.
    """
    angle = evaluate(node, values)
    if not (angle.is_constant and angle.constant.is_integer()):
        raise CircuitError(f"{shown(node)!r} is no constant whole number.")
    return int(angle.constant)


def _affine(node: Any, values: Mapping[str, Angle]) -> Angle:
    match node:
        case ast.IntegerLiteral() | ast.FloatLiteral():
            return Angle.of(float(node.value))
        case ast.Identifier():
            if node.name not in values:
                names = [name for name in values if name.isascii()]
                raise CircuitError(f"Unknown name {node.name!r}.", nearest(node.name, names))
            return values[node.name]
        case ast.UnaryExpression() if node.op.name == "-":
            return -_affine(node.expression, values)
        case ast.FunctionCall() if node.name.name in _FUNCTIONS and len(node.arguments) == 1:
            argument = _affine(node.arguments[0], values)
            if argument.is_constant:
                return Angle.of(_FUNCTIONS[node.name.name](argument.constant))
        case ast.BinaryExpression():
            return _binary(node, _affine(node.lhs, values), _affine(node.rhs, values))
    raise _not_affine(node)


def _binary(node: Any, left: Angle, right: Angle) -> Angle:
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
            terms = [(symbol, c / right.constant) for symbol, c in left.terms]
            return sum(
                (Angle.symbol(symbol) * c for symbol, c in terms),
                Angle.of(left.constant / right.constant),
            )
        case "**" if left.is_constant and right.is_constant:
            return Angle.of(math.pow(left.constant, right.constant))
        case "^":
            raise CircuitError(
                f"{shown(node)!r} is an exclusive or in OpenQASM 3.", "Write ** for a power."
            )
    raise _not_affine(node)


def _not_affine(node: Any) -> CircuitError:
    return CircuitError(
        f"{shown(node)!r} is no affine angle.",
        "An angle is a number, or a sum of number*input and numbers, like 0.5*x1+theta2-pi/2.",
    )
