"""Texts of affine angles, such as "0.5*x1+theta2-pi/2", as numbers."""

from __future__ import annotations

import math
import re

Affine = tuple[float, dict[str, float]]
"""A constant, and the coefficient of each symbol."""

_ROUNDING = 1e-15
_TOKEN = re.compile(
    r"\s*+((?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?(?![\w.])|[^\W\d]\w*+|[-+*/()])"
)


class NotAffineError(ValueError):
    """The text is not an affine expression."""


def affine(text: str) -> Affine:
    """The affine expression that `text` is; names stand for symbols, but for pi.

    Raises:
        NotAffineError: it is none.
        ZeroDivisionError: it divides by zero.
        RecursionError: its brackets are nested too deeply.
    """
    tokens, position, end = [], 0, len(text.rstrip())
    while position < end:
        found = _TOKEN.match(text, position)
        if found is None:
            raise NotAffineError(text)
        tokens.append(found[1])
        position = found.end()
    reader = _Reader(tokens)
    value = reader.sum()
    if reader.token:
        raise NotAffineError(text)
    return value


def sum_of_coefficients(first: float, second: float) -> float:
    """`first + second`, or 0 where they cancel but for what they were rounded by."""
    total = first + second
    return total if abs(total) > _ROUNDING * max(abs(first), abs(second)) else 0.0


class _Reader:
    def __init__(self, tokens: list[str]):
        self._rest = [*reversed(tokens)]
        self.token = self._rest.pop() if tokens else ""

    def _take(self) -> str:
        token, self.token = self.token, self._rest.pop() if self._rest else ""
        return token

    def sum(self) -> Affine:
        constant, terms = self._product()
        while self.token in ("+", "-"):
            sign = 1.0 if self._take() == "+" else -1.0
            more, added = self._product()
            constant += sign * more
            for symbol, coefficient in added.items():
                terms[symbol] = sum_of_coefficients(terms.get(symbol, 0.0), sign * coefficient)
        return constant, terms

    def _product(self) -> Affine:
        left = self._signed()
        while self.token in ("*", "/"):
            operator, right = self._take(), self._signed()
            if operator == "*" and not left[1]:
                left, right = right, left
            if right[1]:
                raise NotAffineError
            factor = right[0]
            left = _scaled(left, factor) if operator == "*" else _divided(left, factor)
        return left

    def _signed(self) -> Affine:
        if self.token == "-":
            self._take()
            return _scaled(self._signed(), -1.0)
        if self.token == "+":
            self._take()
            return self._signed()
        token = self._take()
        if token == "(":
            value = self.sum()
            if self._take() != ")":
                raise NotAffineError
            return value
        if token == "pi":
            return math.pi, {}
        if token[:1] in ("", ")", "*", "/"):
            raise NotAffineError
        return (float(token), {}) if token[0] in ".0123456789" else (0.0, {token: 1.0})


def _scaled(value: Affine, factor: float) -> Affine:
    return value[0] * factor, {symbol: c * factor for symbol, c in value[1].items()}


def _divided(value: Affine, divisor: float) -> Affine:
    return value[0] / divisor, {symbol: c / divisor for symbol, c in value[1].items()}
