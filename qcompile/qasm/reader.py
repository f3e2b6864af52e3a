"""From text to program: the statements of a file, read and run in order."""

from __future__ import annotations

import re
from typing import Any

from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.ir import Program
from qcompile.qasm.fast import FastPath
from qcompile.qasm.interpreter import Interpreter
from qcompile.qasm.layout import Layout
from qcompile.qasm.marks import Mark
from qcompile.qasm.parse import Grammar
from qcompile.qasm.statements import BLANK, Span, spans
from qcompile.qasm.terms import ParseError

_DECLARES_NOTHING = (ast.QuantumGate, ast.QuantumMeasurementStatement, ast.QuantumBarrier)
_GATE_PRAGMA = re.compile(r"#?pragma braket unitary\b")


class Reader:
    """Reads `text` once; `line` is the current line.

    With `fast` false every statement is parsed, with the same result: the tests compare the two.
    With `multiply` inputs may be multiplied by each other: `products` then has the two factors of
    each product, by the name of the input that the product becomes.
    """

    def __init__(self, text: str, *, fast: bool = True, multiply: bool = False):
        self.line = 1
        self.products: dict[str, tuple[str, str]] = {}
        self._text, self._fast, self._multiply = text, fast, multiply
        self._position = self._counted = 0
        self._pragmas: list[str] = []

    def run(
        self,
    ) -> tuple[Program, Layout, tuple[str, ...], tuple[Mark, ...], tuple[int, ...]]:
        """The program, its layout, notes on what was skipped, its marks, the qubit of each bit.

        Raises:
            CircuitError: the text cannot be compiled; `line` says where.
            RecursionError: the text is nested too deeply.
        """
        text = self._text
        if BLANK.match(text).end() == len(text):  # type: ignore[union-attr]
            raise CircuitError(
                "The file is empty.", "A program declares qubits and applies gates to them."
            )
        self._grammar = Grammar(text)
        interpreter = Interpreter(self._grammar.version, self._multiply)
        self._interpreter = interpreter
        fast = FastPath(text, self._grammar.version, interpreter)
        self._position = self._grammar.start
        while True:
            if self._fast:
                self._run_fast(fast)
            span = next(spans(text, self._position), None)
            if span is None:
                self._advance_to(self._position)
                program, layout, marks, qubits = interpreter.finish()
                self.products = interpreter.products
                return program, layout, (*self._notes(), *interpreter.notes()), marks, qubits
            self._position = span.end
            self._advance_to(span.start)
            if span.word.lstrip("#") == "pragma":
                self._skip(span)
            elif not isinstance(self._run(span), _DECLARES_NOTHING):
                fast.forget()

    def _run_fast(self, fast: FastPath) -> None:
        try:
            self._position = fast.run(self._position)
        except CircuitError:
            self._advance_to(fast.stopped)
            raise

    def _run(self, span: Span) -> Any:
        """Run one statement, and return its node."""
        try:
            node = self._grammar.parse(span, self.line)
        except ParseError as fault:
            self.line = fault.line
            raise
        try:
            self._interpreter.run(node)
        except CircuitError:
            self.line = self._interpreter.line
            raise
        return node

    def _advance_to(self, position: int) -> None:
        self.line += self._text.count("\n", self._counted, position)
        self._counted = position

    def _skip(self, span: Span) -> None:
        pragma = " ".join(self._text[span.start : span.end].split())
        if _GATE_PRAGMA.match(pragma):
            raise CircuitError(
                f"The pragma {pragma[:60]!r} defines a gate, which qcompile does not support.",
                "Write the gate as u(theta, phi, lambda).",
            )
        self._pragmas.append(f"{pragma[:60]!r} on line {self.line}")

    def _notes(self) -> tuple[str, ...]:
        if not self._pragmas:
            return ()
        more = len(self._pragmas) - 1
        others = f" and {more} more" if more else ""
        return (f"pragmas are skipped: {self._pragmas[0]}{others}.",)
