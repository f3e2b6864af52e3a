"""The common statements of OpenQASM 3, and all of OpenQASM 2, parsed without ANTLR.

OpenQASM 2 has few words of its own: `in`, `input`, `output`, `gphase`, `pow` and others that
OpenQASM 3 reserves are names there. Both grammars share the nodes of openqasm3.ast.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
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
_INCLUDE = re.compile(r"include\s*+(?:\"([^\"\r\n]+)\"|'([^'\r\n]+)')\s*+;\Z")

WORDS_2 = frozenset("OPENQASM include qreg creg gate opaque barrier measure reset if".split())  # noqa: SIM905
WORDS_3 = frozenset(
    """
    OPENQASM include def cal defcal defcalgrammar gate opaque extern box let break continue if else
    end return for while in switch case default pragma input output const readonly mutable qreg
    qubit creg bool bit int uint float angle complex array void duration stretch gphase inv pow ctrl
    negctrl durationof delay reset measure barrier true false im nop
    """.split()  # noqa: SIM905
)

_MODIFIERS = frozenset("inv pow ctrl negctrl".split())  # noqa: SIM905
_NUMBERS = {
    "bool": ast.BoolType,
    "int": ast.IntType,
    "uint": ast.UintType,
    "float": ast.FloatType,
    "angle": ast.AngleType,
}
_ASSIGNING = frozenset("+ - * / **".split())  # noqa: SIM905
_LEVELS = {"+": 1, "-": 1, "*": 2, "/": 2, "**": 4}
_UNARY_LEVEL = 3


@dataclass
class OpaqueGate(ast.Statement):  # type: ignore[misc]
    """`opaque name(...) qubits;` of OpenQASM 2: a gate without a meaning."""

    name: ast.Identifier


@dataclass
class UnreadSubroutine(ast.Statement):  # type: ignore[misc]
    """A `def` that the parser fails on."""

    name: ast.Identifier


class ParseError(CircuitError):
    """The text is not OpenQASM at `line`."""

    def __init__(self, line: int, what: str, *hints: str):
        super().__init__(what, *hints)
        self.line = line


def parse_2(text: str, line: int) -> Any:
    """The node of one statement of OpenQASM 2 that starts in `line`.

    Raises:
        ParseError: it is none.
    """
    return _Parser(text, line, WORDS_2, "^").whole(2)


def parse_3(text: str, line: int) -> Any:
    """The node of one statement of OpenQASM 3, if it is a common one: a gate or its definition, a
    measurement, a barrier, a reset, an include, a number declared or assigned.

    Raises:
        ParseError: it is another one, or none.
    """
    return _Parser(text, line, WORDS_3, "**").whole(3)


def unexpected(line: int, token: str) -> ParseError:
    """What a parser says of the first token that it cannot use; "" is the end of the text."""
    if token:
        return ParseError(line, f"Syntax error at {token[:60]!r}.", "Is a ';' missing before it?")
    return ParseError(line, "The file ends within a statement.", "Is a ';' or a bracket missing?")


class _Parser:
    """Recursive descent over the tokens of one statement; `power` is the operator of powers."""

    def __init__(self, text: str, line: int, words: frozenset[str], power: str):
        self._text, self._line, self._words, self._power = text, line, words, power
        self._position = self._counted = 0
        self._advance()

    def _advance(self) -> None:
        start = BLANK.match(self._text, self._position).end()  # type: ignore[union-attr]
        self._line += self._text.count("\n", self._counted, start)
        self._counted = start
        found = _TOKEN.match(self._text, start)
        if found is None and start < len(self._text):
            raise unexpected(self._line, self._text[start : start + 20])
        self._token = found[0] if found else ""
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
        """One item or more with commas between them, to `end`."""
        items = [item()]
        while self._take(",", end) == ",":
            items.append(item())
        return items

    def _list(self, item: Callable[[], Any], end: str) -> list[Any]:
        """`_items`, or none at all."""
        return [] if self._taken(end) else self._items(item, end)

    def whole(self, version: int) -> Any:
        line = self._line
        if include := _INCLUDE.match(self._text):
            node: Any = ast.Include(include[1] or include[2])
            node.span = ast.Span(line, 0, line, 0)
            return node
        node = self._statement(version)
        if self._token:
            raise unexpected(self._line, self._token)
        return node

    def _statement(self, version: int) -> Any:
        line = self._line
        node = self._words_of_both()
        if node is None:
            node = self._words_of_2() if version == 2 else self._words_of_3()
        if node is None:
            node = self._measured_or_applied(version)
        node.span = ast.Span(line, 0, line, 0)
        return node

    def _words_of_both(self) -> Any:
        match self._token:
            case "gate":
                return self._definition()
            case "barrier":
                self._advance()
                return ast.QuantumBarrier(self._items(self._operand, ";"))
            case "reset":
                self._advance()
                node = ast.QuantumReset(self._operand())
                self._take(";")
                return node
            case "measure":
                self._advance()
                measured = ast.QuantumMeasurement(self._operand())
                target = self._operand() if self._take("->", ";") == "->" else None
                if target is not None:
                    self._take(";")
                return ast.QuantumMeasurementStatement(measured, target)
        return None

    def _words_of_2(self) -> Any:
        match self._token:
            case "qreg" | "creg" as word:
                self._advance()
                name = self._identifier()
                self._take("[")
                size = self._expression()
                self._take("]")
                self._take(";")
                if word == "qreg":
                    return ast.QubitDeclaration(name, size)
                return ast.ClassicalDeclaration(ast.BitType(size), name)
            case "opaque":
                self._advance()
                name = self._identifier()
                if self._taken("("):
                    self._list(self._identifier, ")")
                self._items(self._identifier, ";")
                return OpaqueGate(name)
            case "if":
                self._advance()
                self._take("(")
                left = self._identifier()
                self._take("==")
                condition = ast.BinaryExpression(ast.BinaryOperator["=="], left, self._expression())
                self._take(")")
                return ast.BranchingStatement(condition, [self._statement(2)], [])
        return None

    def _words_of_3(self) -> Any:
        if self._token in _MODIFIERS or self._token == "gphase":
            return self._modified(self._operand)
        if self._taken("const"):
            type, name = self._number_type(), self._identifier()
            self._take("=")
            node = ast.ConstantDeclaration(type, name, self._expression())
            self._take(";")
            return node
        if self._token in _NUMBERS:
            type, name = self._number_type(), self._identifier()
            value = self._expression() if self._take("=", ";") == "=" else None
            if value is not None:
                self._take(";")
            return ast.ClassicalDeclaration(type, name, value)
        return None

    def _number_type(self) -> Any:
        make = _NUMBERS[self._take(*_NUMBERS)]
        if make is ast.BoolType or not self._taken("["):
            return make()
        size = self._expression()
        self._take("]")
        return make(size)

    def _modified(self, operand: Callable[[], Any]) -> Any:
        """A gate or a global phase of OpenQASM 3, with its modifiers."""
        modifiers = []
        while self._token in _MODIFIERS:
            kind, argument = ast.GateModifierName[self._take()], None
            if self._taken("("):
                argument = self._expression()
                self._take(")")
            self._take("@")
            modifiers.append(ast.QuantumGateModifier(kind, argument))
        if not self._taken("gphase"):
            node = self._gate(self._identifier(), operand)
            node.modifiers = modifiers
            return node
        self._take("(")
        phase = self._expression()
        self._take(")")
        return ast.QuantumPhase(modifiers, phase, self._list(operand, ";"))

    def _definition(self) -> Any:
        self._advance()
        name = self._identifier()
        arguments = self._list(self._identifier, ")") if self._taken("(") else []
        qubits = self._items(self._identifier, "{")
        body = []
        while not self._taken("}"):
            body.append(self._inner_statement())
        return ast.QuantumGateDefinition(name, arguments, qubits, body)

    def _inner_statement(self) -> Any:
        line = self._line
        if self._taken("barrier"):
            node: Any = ast.QuantumBarrier(self._items(self._identifier, ";"))
        elif self._words is WORDS_3:
            node = self._modified(self._identifier)
        else:
            node = self._gate(self._identifier(), self._identifier)
        node.span = ast.Span(line, 0, line, 0)
        return node

    def _measured_or_applied(self, version: int) -> Any:
        name = self._identifier()
        if version == 3 and self._token in _ASSIGNING:
            return self._assignment(name, f"{self._take()}=")
        if version == 3 and self._token in ("=", "["):
            target = self._indexed(name)
            if target is name and self._text[self._position :].lstrip()[:7] != "measure":
                return self._assignment(name, "=")
            self._take("=")
            self._take("measure")
            measured = ast.QuantumMeasurement(self._operand())
            self._take(";")
            return ast.QuantumMeasurementStatement(measured, target)
        return self._gate(name, self._operand)

    def _assignment(self, name: Any, operator: str) -> Any:
        self._take("=")
        value = self._expression()
        self._take(";")
        return ast.ClassicalAssignment(name, ast.AssignmentOperator[operator], value)

    def _gate(self, name: Any, operand: Callable[[], Any]) -> Any:
        arguments = self._list(self._expression, ")") if self._taken("(") else []
        return ast.QuantumGate([], name, arguments, self._items(operand, ";"), None)

    def _identifier(self) -> Any:
        name = self._token
        if not _NAME.match(name) or name in self._words or not _legal(name):
            raise unexpected(self._line, name)
        self._advance()
        return ast.Identifier(name)

    def _operand(self) -> Any:
        if self._token.startswith("$") and len(self._token) > 1:
            return ast.Identifier(self._take())
        return self._indexed(self._identifier())

    def _indexed(self, name: Any) -> Any:
        if not self._taken("["):
            return name
        index = self._expression()
        self._take("]")
        return ast.IndexedIdentifier(name, [[index]])

    def _expression(self, least: int = 1) -> Any:
        """Precedence climbing; sums and products of any length take no recursion."""
        left = self._value()
        while (level := _LEVELS.get(self._operator(), 0)) >= least:
            operator = self._operator()
            self._advance()
            # A power is grouped from the right, everything else from the left.
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
    """Whether letters beyond ASCII are such that a name may have; a superscript is none."""
    return name.isascii() or name.isidentifier()
