"""The operators and functions of OpenQASM 3 on typed values."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence

from qcompile.ir import Angle
from qcompile.ir.products import product
from qcompile.qasm.values import BOOL, FLOAT, INT, Type, Value, rounded

_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le,
    ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_BITWISE: dict[str, Callable[[int, int], int]] = {
    "&": operator.and_,
    "|": operator.or_,
    "^": operator.xor,
}
_WHOLE: dict[str, Callable[[int, int], int]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": lambda a, b: abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1),
    "%": lambda a, b: abs(a) % abs(b) * (1 if a >= 0 else -1),
}
"""Division is towards zero, as in C99."""

_REAL: dict[str, Callable[[float], float]] = {
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
    "ceiling": lambda x: float(math.ceil(x)),
    "floor": lambda x: float(math.floor(x)),
}

_MAX_NUMBER_BITS = 4096


class NoOperationError(Exception):
    """There is no such operation, or its result is not affine in the inputs."""


class AmbiguousError(Exception):
    """Compilers disagree on the value; the arguments say how, and what to write instead."""


def unary(symbol: str, value: Value, *, to_whole: bool) -> Value:
    """The value of `-x`, `!x` or `~x`; see `binary`."""
    kind = value.type.kind
    if symbol == "!":
        return Value(BOOL, 1 - value.to(BOOL).whole)
    if symbol == "~" and value.type.has_bits:
        return _wrapped(value.type, ~value.whole)
    if symbol != "-" or kind in ("bool", "bit"):
        raise NoOperationError
    if isinstance(value.number, Angle):
        return Value(value.type, -value.number)
    if kind == "angle":
        return _wrapped(value.type, -value.number)
    return binary("-", Value(INT, 0), value, to_whole=to_whole)


def binary(
    symbol: str, left: Value, right: Value, *, to_whole: bool, products: bool = False
) -> Value:
    """The value of `left symbol right`; with `products` inputs can be multiplied by each other.

    `to_whole` means that the result will be converted to a whole number. Otherwise two operations
    are refused because compilers disagree on them: a quotient of whole numbers with a remainder,
    and one of a uint[n] and a number without a width whose result does not fit uint[n].

    Raises:
        NoOperationError: there is no such operation.
        AmbiguousError: one of these two operations.
        CircuitError: an operand cannot be converted, or the result is not finite.
        ArithmeticError: a division by zero, or a number too large.
    """
    if symbol in ("&&", "||"):
        a, b = left.to(BOOL).whole, right.to(BOOL).whole
        return Value(BOOL, a & b if symbol == "&&" else a | b)
    if symbol in ("<<", ">>") and left.type.has_bits:
        return _shifted(symbol, left, right)
    if symbol in _BITWISE:
        return _bitwise(symbol, left, right)
    if "bit" in (left.type.kind, right.type.kind):
        raise NoOperationError
    if "angle" in (left.type.kind, right.type.kind):
        result = _angles(symbol, left, right)
        if result is not None:
            return result
    elif isinstance(left.number, int) and isinstance(right.number, int):
        return _whole_numbers(symbol, left, right, to_whole)
    return _reals(symbol, left, right, products)


def call(name: str, arguments: Sequence[Value]) -> Value:
    """The value of a function of the language.

    Raises:
        NoOperationError: there is no such function of these arguments.
    """
    if name in _REAL and len(arguments) == 1 and arguments[0].type.kind not in ("bool", "bit"):
        argument = arguments[0].radians
        if argument.is_constant:
            return Value.real(_REAL[name](argument.constant))
    if name == "popcount" and len(arguments) == 1 and arguments[0].type.has_bits:
        return Value(INT, arguments[0].whole.bit_count())
    if len(arguments) == 2:
        if name == "mod":
            return binary("%", *arguments, to_whole=True)
        if name in ("rotl", "rotr") and arguments[0].type.has_bits:
            value, bits = arguments[0], arguments[0].type.bits
            places = arguments[1].to(INT).whole % bits * (1 if name == "rotl" else -1) % bits
            return _wrapped(value.type, value.whole << places | value.whole >> bits - places)
    raise NoOperationError


def _wrapped(kind: Type, number: int) -> Value:
    return Value(kind, number % (1 << kind.bits))


def _shifted(symbol: str, left: Value, right: Value) -> Value:
    places = min(right.to(INT).whole, left.type.bits)
    if places < 0:
        raise NoOperationError
    return _wrapped(left.type, left.whole << places if symbol == "<<" else left.whole >> places)


def _bitwise(symbol: str, left: Value, right: Value) -> Value:
    if left.type != right.type or not left.type.has_bits:
        raise NoOperationError
    return Value(left.type, _BITWISE[symbol](left.whole, right.whole))


def _angles(symbol: str, left: Value, right: Value) -> Value | None:
    """Arithmetic of angles, as of unsigned whole numbers; None if the operation is on reals."""
    kinds = left.type.kind, right.type.kind
    if symbol in ("*", "/"):
        if kinds == ("angle", "angle") and symbol == "/":
            common = _common(left.type, right.type)
            return Value(
                Type("uint", common.width), left.to(common).whole // right.to(common).whole
            )
        factor, angle = (left, right) if kinds[1] == "angle" else (right, left)
        if not factor.type.is_whole:
            return None
        if symbol == "*":
            return _wrapped(angle.type, angle.whole * factor.whole)
        if angle is right or factor.whole < 0:
            raise NoOperationError
        return Value(angle.type, angle.whole // factor.whole)
    if symbol not in ("+", "-", *_COMPARISONS):
        return None
    if not (left.radians.is_constant and right.radians.is_constant):
        return None
    common = _common(left.type, right.type)
    a, b = left.to(common).whole, right.to(common).whole
    if symbol in _COMPARISONS:
        return Value(BOOL, int(_COMPARISONS[symbol](a, b)))
    return _wrapped(common, _WHOLE[symbol](a, b))


def _common(left: Type, right: Type) -> Type:
    """The type of the wider angle, or of the only operand that is an angle."""
    angles = [kind for kind in (left, right) if kind.kind == "angle"]
    return max(angles, key=lambda kind: kind.bits)


def _whole_numbers(symbol: str, left: Value, right: Value, to_whole: bool) -> Value:
    a, b = left.whole, right.whole
    if symbol in _COMPARISONS:
        return Value(BOOL, int(_COMPARISONS[symbol](a, b)))
    if symbol == "**":
        if b < 0:
            return _reals(symbol, left, right)
        if a.bit_length() * b > _MAX_NUMBER_BITS:
            raise OverflowError
        number = a**b
    elif symbol in _WHOLE:
        if symbol == "/" and a % b and not to_whole:
            raise AmbiguousError(
                "divides whole numbers, which OpenQASM 3 rounds towards zero",
                "Write one of them with a point, such as 1.0/2.",
            )
        number = _WHOLE[symbol](a, b)
    else:
        raise NoOperationError
    if number.bit_length() > _MAX_NUMBER_BITS:
        raise OverflowError
    return _in_range(number, left.type, right.type, to_whole)


def _in_range(number: int, left: Type, right: Type, to_whole: bool) -> Value:
    sized = [kind for kind in (left, right) if kind.kind == "uint" and kind.width is not None]
    if not sized:
        return Value(INT, number)
    wider = max(sized, key=lambda kind: kind.bits)
    if len(sized) == 2:
        return _wrapped(wider, number)
    if 0 <= number < 1 << wider.bits:
        return Value(wider if INT in (left, right) else INT, number)
    if not to_whole:
        raise AmbiguousError(
            f"is {number}, which does not fit {wider}; compilers disagree on the result",
            f"Assign it to a {wider} to wrap it, or compute with int(...) to avoid that.",
        )
    return Value(INT, number)


def _reals(symbol: str, left: Value, right: Value, products: bool = False) -> Value:
    a, b = left.radians, right.radians
    both = a.is_constant and b.is_constant
    if symbol in _COMPARISONS and both:
        return Value(BOOL, int(_COMPARISONS[symbol](a.constant, b.constant)))
    match symbol:
        case "+":
            number = a + b
        case "-":
            number = a - b
        case "*" if a.is_constant or b.is_constant:
            number = a * b
        case "*" if products:
            number = product(a, b)
        case "/" if b.is_constant:
            number = a / b
        case "**" if both:
            number = Angle.of(math.pow(a.constant, b.constant))
        case "%" if both:
            number = Angle.of(math.fmod(a.constant, b.constant))
        case _:
            raise NoOperationError
    kind = _common_float(left.type, right.type)
    return Value(kind, rounded(number, kind))


def _common_float(left: Type, right: Type) -> Type:
    """The float type of a result: the wider one; a number without a width is as wide as any."""
    if left.kind == right.kind == "float" and left.width and right.width:
        return max(left, right, key=lambda kind: kind.bits)
    return FLOAT
