"""Expressions of a program file: typed values, affine angles, whole numbers."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass, field
from typing import Any

import openqasm3
from openqasm3 import ast

from qcompile.catalogue import nearest
from qcompile.errors import CircuitError
from qcompile.ir import Angle
from qcompile.qasm import operators
from qcompile.qasm.values import BOOL, FLOAT, INT, MAX_BITS, Type, Value

CONSTANTS = {
    name: Value.real(value)
    for names, value in (("pi π", math.pi), ("tau τ", math.tau), ("euler ℇ", math.e))
    for name in names.split()
}

_SHOWN_CHARACTERS = 60


def source_of(node: Any) -> str:
    """The source of a node as one short line, for messages."""
    try:
        lines = openqasm3.dumps(node).strip().splitlines() or [""]
    except RecursionError:
        return "..."
    text = (
        lines[min(len(getattr(node, "annotations", ())), len(lines) - 1)]
        .rstrip("; ")
        .removesuffix(" {")
    )
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."


@dataclass(frozen=True)
class Scope:
    """The names an expression may use.

    Gate bodies see `constants`, which include inputs, but not `variables`, which include the
    constants of blocks. With `real` every number is a real number, as in OpenQASM 2; with
    `products` inputs can be multiplied by each other (see `ir.products`).
    """

    constants: MutableMapping[str, Value]
    variables: dict[str, Value | None] = field(default_factory=dict)
    real: bool = False
    products: bool = False

    def inner(self, values: Mapping[str, Angle]) -> Scope:
        """The scope of a gate body, in which `values` hide the file's names."""
        arguments = {name: Value(FLOAT, angle) for name, angle in values.items()}
        return Scope(ChainMap(arguments, self.constants), {}, self.real, self.products)

    def evaluate(self, node: Any) -> Angle:
        """The value of an expression as an affine angle.

        Raises:
            CircuitError: a name is unknown, or the value is not affine, finite and a number.
        """
        value = self.value(node)
        if value.type.kind in ("bool", "bit"):
            raise CircuitError(f"{source_of(node)!r} is a {value.type}, not an angle.")
        return value.radians

    def whole_number(self, node: Any) -> int:
        """The value of a constant integer expression.

        Raises:
            CircuitError: the expression is not a constant integer.
        """
        number = self.evaluate_whole(node)
        if number is None:
            raise CircuitError(f"{source_of(node)!r} is not a constant whole number.")
        return number

    def evaluate_whole(self, node: Any) -> int | None:
        """`whole_number`, or None if the value is not a constant integer."""
        value = self.value(node, to_whole=True)
        if isinstance(value.number, Angle):
            constant = value.number.constant
            whole = value.number.is_constant and constant.is_integer()
            return int(constant) if whole else None
        return value.number if value.type.is_whole else None

    def value(self, node: Any, *, to_whole: bool = False) -> Value:
        """The value of an expression; `to_whole` if it will be converted to a whole number.

        Raises:
            CircuitError: a name is unknown, or there is no such value.
        """
        try:
            # A long sum nests in its left operands, so a loop over those needs no recursion.
            parents = []
            while isinstance(node, ast.BinaryExpression):
                parents.append(node)
                node = node.lhs
            value = self._leaf(node, to_whole)
            for node in reversed(parents):
                right = self.value(node.rhs, to_whole=to_whole)
                value = operators.binary(
                    node.op.name, value, right, to_whole=to_whole, products=self.products
                )
            return value
        except operators.NoOperationError as error:
            raise _not_affine(node) from error
        except operators.AmbiguousError as error:
            what, hint = error.args
            raise CircuitError(f"{source_of(node)!r} {what}.", hint) from error
        except ZeroDivisionError as error:
            raise CircuitError(f"{source_of(node)!r} divides by zero.") from error
        except (OverflowError, ValueError) as error:
            if isinstance(error, CircuitError):
                raise
            raise CircuitError(f"{source_of(node)!r} is not a finite real number.") from error

    def named(self, name: str) -> Value:
        """The value of a name.

        Raises:
            CircuitError: the name is unknown, or has no value yet.
        """
        if name in self.variables:
            value = self.variables[name]
            if value is None:
                raise CircuitError(
                    f"{name!r} has no value yet.", "Assign one before its first use."
                )
            return value
        if name not in self.constants:
            names = [name for name in (*self.constants, *self.variables) if name.isascii()]
            raise CircuitError(f"Unknown name {name!r}.", nearest(name, names))
        return self.constants[name]

    def type_of(self, node: Any) -> Type | None:
        """The type in a declaration or a cast; None for a type that is not numeric.

        Raises:
            CircuitError: the size of the type is out of range.
        """
        match node:
            case ast.BoolType() | ast.BitType(size=None):
                return BOOL
            case ast.BitType() | ast.IntType() | ast.UintType() | ast.FloatType() | ast.AngleType():
                kind = type(node).__name__.removesuffix("Type").lower()
            case _:
                return None
        width = None if node.size is None else self.whole_number(node.size)
        if width is not None and not 1 <= width <= MAX_BITS:
            raise CircuitError(
                f"{kind}[{width}] is not supported.", f"Sizes are 1 to {MAX_BITS} bits."
            )
        if kind == "float" and width is not None and width < 64 and width not in (16, 32):
            raise CircuitError(f"float[{width}] is not supported.", "Use float[32] or float[64].")
        return Type(kind, width)  # type: ignore[arg-type]

    def _leaf(self, node: Any, to_whole: bool) -> Value:
        match node:
            case ast.IntegerLiteral():
                return Value.real(float(node.value)) if self.real else Value(INT, node.value)
            case ast.FloatLiteral():
                return Value.real(node.value)
            case ast.BooleanLiteral():
                return Value(BOOL, int(node.value))
            case ast.BitstringLiteral() if node.width <= MAX_BITS:
                return Value(Type("bit", node.width), node.value)
            case ast.Identifier():
                return self.named(node.name)
            case ast.UnaryExpression():
                value = self.value(node.expression, to_whole=to_whole)
                return operators.unary(node.op.name, value, to_whole=to_whole)
            case ast.FunctionCall():
                arguments = [self.value(argument) for argument in node.arguments]
                return operators.call(node.name.name, arguments)
            case ast.Cast():
                target = self.type_of(node.type)
                if target is not None:
                    value = self.value(node.argument, to_whole=target.is_whole)
                    return value.to(target, cast=True)
        raise operators.NoOperationError


def _not_affine(node: Any) -> CircuitError:
    if isinstance(node, ast.BinaryExpression) and node.op.name == "^":
        return CircuitError(
            f"{source_of(node)!r} is an exclusive or in OpenQASM 3.", "Write ** for a power."
        )
    return CircuitError(
        f"{source_of(node)!r} is not an affine angle.",
        "An angle is a number, or a sum of number*input and numbers, like 0.5*x1+theta2-pi/2.",
    )
