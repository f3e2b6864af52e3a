"""The tokens of an OpenQASM statement, and a parser for the names and expressions in it."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.qasm.statements import BLANK

_TOKEN = re.compile(
    r"(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?(?![\w.])"
    r"|[^\W\d]\w*+|\$[0-9]++|->|\*\*|==|[^\s\w]"
)
_NUMBER = re.compile(r"[0-9.]")
_NAME = re.compile(r"[^\W\d]\w*\Z")

WORDS_2 = frozenset("OPENQASM include qreg creg gate opaque barrier measure reset if".split())  # noqa: SIM905
WORDS_3 = frozenset(
    """
    OPENQASM include def cal defcal defcalgrammar gate opaque extern box let break continue if else
    end return for while in switch case default pragma input output const readonly mutable qreg
    qubit creg bool bit int uint float angle complex array void duration stretch gphase inv pow ctrl
    negctrl durationof delay reset measure barrier true false im nop
    """.split()  # noqa: SIM905
)

_LEVELS = {"+": 1, "-": 1, "*": 2, "/": 2, "**": 4}
_UNARY_LEVEL = 3


class ParseError(CircuitError):
    """The text is not OpenQASM at `line`."""

    def __init__(self, line: int, what: str, *hints: str):
        super().__init__(what, *hints)
        self.line = line


def unexpected(line: int, token: str) -> ParseError:
    """The error for the first token that does not fit; "" is the end of the text."""
    if token:
        return ParseError(line, f"Syntax error at {token[:60]!r}.", "Is a ';' missing before it?")
    return ParseError(line, "The file ends within a statement.", "Is a ';' or a bracket missing?")


class ExpressionParser:
    """Recursive descent over the tokens of one statement; `power` is the power operator."""

    def __init__(self, text: str, line: int, words: frozenset[str], power: str):
        self._text, self._line, self._words, self._power = text, line, words, power
        self._position = self._counted = 0
        self._advance()

    def _advance(self) -> None:
        start = BLANK.match(self._text, self._position).end()  # type: ignore[union-attr]
        self._line += self._text.count("\n", self._counted, start)
        self._counted = start
        match = _TOKEN.match(self._text, start)
        if match is None and start < len(self._text):
            raise unexpected(self._line, self._text[start : start + 20])
        self._token = match[0] if match else ""
        self._position = start + len(self._token)

    def _take(self, *wanted: str) -> str:
        token = self._token
        if wanted and token not in wanted:
            raise unexpected(self._line, token)
        self._advance()
        return token

    def _taken(self, token: str) -> bool:
        if self._token != token:
            return False
        self._advance()
        return True

    def _items(self, item: Callable[[], Any], end: str) -> list[Any]:
        """One or more items, separated by commas, up to `end`."""
        items = [item()]
        while self._take(",", end) == ",":
            items.append(item())
        return items

    def _list(self, item: Callable[[], Any], end: str) -> list[Any]:
        """Any number of items, separated by commas, up to `end`."""
        return [] if self._taken(end) else self._items(item, end)

    def _identifier(self) -> Any:
        name = self._token
        if not _NAME.match(name) or name in self._words or not _legal(name):
            raise unexpected(self._line, name)
        self._advance()
        return ast.Identifier(name)

    def _indexed(self, name: Any) -> Any:
        if not self._taken("["):
            return name
        index = self._expression()
        self._take("]")
        return ast.IndexedIdentifier(name, [[index]])

    def _expression(self, least: int = 1) -> Any:
        """Precedence climbing; sums and products of any length need no recursion."""
        left = self._value()
        while (level := _LEVELS.get(self._operator(), 0)) >= least:
            operator = self._operator()
            self._advance()
            # Powers are right-associative, all other operators left-associative.
            right = self._expression(level if operator == "**" else level + 1)
            left = ast.BinaryExpression(ast.BinaryOperator[operator], left, right)
        return left

    def _operator(self) -> str:
        if self._token == self._power:
            return "**"
        return "" if self._token == "**" else self._token

    def _value(self) -> Any:
        token = self._token
        if _NUMBER.match(token):
            self._advance()
            return _literal(token, self._line)
        if token == "-":
            self._advance()
            return ast.UnaryExpression(ast.UnaryOperator["-"], self._expression(_UNARY_LEVEL))
        if token == "+":
            self._advance()
            return self._expression(_UNARY_LEVEL)
        if token == "(":
            self._advance()
            value = self._expression()
            self._take(")")
            return value
        name = self._identifier()
        if self._taken("("):
            return ast.FunctionCall(name, self._list(self._expression, ")"))
        return name


def _literal(token: str, line: int) -> Any:
    try:
        return ast.IntegerLiteral(int(token)) if token.isdigit() else ast.FloatLiteral(float(token))
    except ValueError as error:
        raise unexpected(line, token) from error


def _legal(name: str) -> bool:
    """Whether the characters beyond ASCII are letters, as a name needs, and not superscripts."""
    return name.isascii() or name.isidentifier()
