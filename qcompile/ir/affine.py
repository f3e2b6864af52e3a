"""Affine expressions, such as "0.5*x1+theta2-pi/2": parsing and arithmetic."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

Affine = tuple[float, dict[str, float]]
"""A constant, and the coefficient of each symbol."""

_ROUNDING = 1e-15
_TOKEN = re.compile(
    r"\s*+((?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?(?![\w.])|[^\W\d]\w*+|[-+*/()])"
)


class NotAffineError(ValueError):
    """An expression is not affine in its symbols."""


def affine(text: str) -> Affine:
    """The affine expression written in `text`; every name but pi is a symbol.

    Raises:
        NotAffineError: the text is not an affine expression.
        ZeroDivisionError: it divides by zero.
        RecursionError: its brackets are nested too deeply.
    """
    tokens, position, end = [], 0, len(text.rstrip())
    while position < end:
        match = _TOKEN.match(text, position)
        if match is None:
            raise NotAffineError(text)
        tokens.append(match[1])
        position = match.end()
    reader = _Reader(tokens)
    value = reader.sum()
    if reader.token:
        raise NotAffineError(text)
    return value


def add_terms(terms: dict[str, float], more: Iterable[tuple[str, float]], sign: float) -> None:
    """Add `sign` times `more` to `terms`; terms that cancel up to rounding become 0."""
    for symbol, coefficient in more:
        before, added = terms.get(symbol, 0.0), sign * coefficient
        total = before + added
        rounding = _ROUNDING * max(abs(before), abs(added))
        terms[symbol] = total if abs(total) > rounding else 0.0


def multiply(left: Affine, right: Affine) -> Affine:
    """The product of two affine expressions.

    Raises:
        NotAffineError: both contain symbols.
    """
    if not left[1]:
        left, right = right, left
    if right[1]:
        raise NotAffineError
    factor = right[0]
    return left[0] * factor, {symbol: c * factor for symbol, c in left[1].items()}


def divide(left: Affine, right: Affine) -> Affine:
    """The quotient of two affine expressions.

    Raises:
        NotAffineError: the divisor contains symbols.
        ZeroDivisionError: the divisor is zero.
    """
    if right[1]:
        raise NotAffineError
    divisor = right[0]
    return left[0] / divisor, {symbol: c / divisor for symbol, c in left[1].items()}


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
            number, more = self._product()
            constant += sign * number
            add_terms(terms, more.items(), sign)
        return constant, terms

    def _product(self) -> Affine:
        left = self._signed()
        while self.token in ("*", "/"):
            operation = multiply if self._take() == "*" else divide
            left = operation(left, self._signed())
        return left

    def _signed(self) -> Affine:
        if self.token == "-":
            self._take()
            return multiply(self._signed(), (-1.0, {}))
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
