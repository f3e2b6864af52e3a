"""The common statements of OpenQASM 3, and all of OpenQASM 2, parsed without ANTLR.

OpenQASM 2 has few keywords: `in`, `input`, `output`, `gphase`, `pow` and other words that
OpenQASM 3 reserves are names there. Both grammars use the nodes of openqasm3.ast.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from openqasm3 import ast

from qcompile.qasm.terms import WORDS_2, WORDS_3, ExpressionParser, unexpected

_INCLUDE = re.compile(r"include\s*+(?:\"([^\"\r\n]+)\"|'([^'\r\n]+)')\s*+;\Z")

_MODIFIERS = frozenset("inv pow ctrl negctrl".split())  # noqa: SIM905
_NUMBERS = {
    "bool": ast.BoolType,
    "int": ast.IntType,
    "uint": ast.UintType,
    "float": ast.FloatType,
    "angle": ast.AngleType,
}
_ASSIGNING = frozenset("+ - * / **".split())  # noqa: SIM905


@dataclass
class OpaqueGate(ast.Statement):  # type: ignore[misc]
    """`opaque name(...) qubits;` of OpenQASM 2: a gate without a definition."""

    name: ast.Identifier


@dataclass
class UnreadSubroutine(ast.Statement):  # type: ignore[misc]
    """A `def` that the parser cannot read."""

    name: ast.Identifier


def parse_2(text: str, line: int) -> Any:
    """The node of one statement of OpenQASM 2 that starts in `line`.

    Raises:
        ParseError: the text is not a statement of OpenQASM 2.
    """
    return _Parser(text, line, WORDS_2, "^").whole(2)


def parse_3(text: str, line: int) -> Any:
    """The node of one common statement of OpenQASM 3: a gate or its definition, a measurement, a
    barrier, a reset, an include, the declaration or assignment of a number.

    Raises:
        ParseError: it is another statement, or none.
    """
    return _Parser(text, line, WORDS_3, "**").whole(3)


class _Parser(ExpressionParser):
    """Recursive descent over one statement."""

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
        node = self._statement_of_both()
        if node is None:
            node = self._statement_of_2() if version == 2 else self._statement_of_3()
        if node is None:
            node = self._measured_or_applied(version)
        node.span = ast.Span(line, 0, line, 0)
        return node

    def _statement_of_both(self) -> Any:
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

    def _statement_of_2(self) -> Any:
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

    def _statement_of_3(self) -> Any:
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

    def _operand(self) -> Any:
        if self._token.startswith("$") and len(self._token) > 1:
            return ast.Identifier(self._take())
        return self._indexed(self._identifier())
