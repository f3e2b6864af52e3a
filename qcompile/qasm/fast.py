"""The fast path: gates on one operand or two, by far the most common ones of a long file.

A text such as `rz(0.5)` or `q[3]` is parsed once, by the grammar and the interpreter, and looked up
from then on. Every other statement is left to them, so the result is the same.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.ir import Angle, Gate
from qcompile.ir.wires import Step
from qcompile.qasm.grammar import parse_2, parse_3
from qcompile.qasm.interpreter import Interpreter
from qcompile.qasm.modifiers import Unitary
from qcompile.qasm.statements import BLANK
from qcompile.qasm.terms import WORDS_2, WORDS_3

_BLANKS = BLANK.pattern
_OPERAND = r"(\$?\w++(?:\[[0-9]++\])?+)[ \t]*+"
_STATEMENT = re.compile(
    rf"{_BLANKS}([A-Za-z]\w*+(?:[ \t]*+\((?:[^;(){{}}/\"]|/(?![/*]))*+\))?+)[ \t]*+"
    rf"(?<=[ \t)]){_OPERAND}(?:,[ \t]*+{_OPERAND})?+;"
)
_NUMBER = r"[ \t\r\n]*+-?(?:[0-9]++\.?[0-9]*+|\.[0-9]++)(?:[eE][+-]?[0-9]++)?[ \t\r\n]*+"
_NUMBERS = re.compile(rf"{_NUMBER}(?:,{_NUMBER})*+\)\Z")
_MAX_TEXTS = 50_000
"""The most texts in the cache: the angles of a long file are mostly different."""


class FastPath:
    """Runs the plain statements of `text`, with the results of `interpreter`."""

    def __init__(self, text: str, version: str | None, interpreter: Interpreter):
        self._text, self._interpreter = text, interpreter
        self.stopped = 0
        self._parse, self._words = (parse_2, WORDS_2) if version == "2" else (parse_3, WORDS_3)
        self._gates: dict[str, Sequence[Gate]] = {}
        self._steps: dict[str, Sequence[Step]] = {}
        self._qubits: dict[str, Sequence[int]] = {}

    def run(self, position: int) -> int:
        """Run the plain statements from `position` on; returns where the next other one starts.

        Raises:
            CircuitError: the program has too many gates, from the statement at `stopped` on.
        """
        match, text, append = _STATEMENT.match, self._text, self._interpreter.append
        while statement := match(text, position):
            head, operand, second = statement.groups()
            if second is not None:
                if not self._run_two(statement, head, operand, second):
                    break
                position = statement.end()
                continue
            gates = self._gates.get(head)
            if gates is None and (gates := self._parse_gate(head)) is None:
                break
            qubits = self._qubits.get(operand)
            if qubits is None and (qubits := self._resolve(operand)) is None:
                break
            try:
                if not append(gates, qubits):
                    break
            except CircuitError:
                self.stopped = statement.start(1)
                raise
            position = statement.end()
        return position

    def forget(self) -> None:
        """Clear the cache, because a declaration may change the meaning of a text."""
        self._gates.clear()
        self._steps.clear()

    def _run_two(self, statement: re.Match[str], head: str, *operands: str) -> bool:
        """Run a gate on two qubits; False if it is left to the others."""
        steps = self._steps.get(head)
        if steps is None:
            unitary = self._unitary(head, 2)
            if unitary is None:
                return False
            steps = unitary.steps
            if len(self._steps) < _MAX_TEXTS:
                self._steps[head] = steps
        qubits: list[int] = []
        for operand in operands:
            found = self._qubits.get(operand) or self._resolve(operand)
            if found is None or len(found) != 1:
                return False
            qubits += found
        if qubits[0] == qubits[1]:
            return False
        try:
            return self._interpreter.apply(steps, qubits) is None
        except CircuitError:
            self.stopped = statement.start(1)
            raise

    def _parse_gate(self, head: str) -> Sequence[Gate] | None:
        unitary = self._unitary(head, 1)
        if unitary is None:
            return None
        gates = tuple(unitary.gates)
        if len(self._gates) < _MAX_TEXTS:
            self._gates[head] = gates
        return gates

    def _unitary(self, head: str, width: int) -> Unitary | None:
        """What a text such as `rz(0.5)` does to `width` qubits; None if it is left to others."""
        name, _, arguments = head.partition("(")
        name = name.strip()
        try:
            if name in self._words:
                return None
            if _NUMBERS.match(arguments):
                numbers = [float(text) for text in arguments[:-1].split(",")]
                if not all(map(math.isfinite, numbers)):
                    return None
                angles = list(map(Angle, numbers))
            else:
                gate = self._parse(f"{head} q;", 1)
                angles = list(map(self._interpreter.evaluate, gate.arguments))
            return self._interpreter.gates.call(name, angles, width)
        except (CircuitError, RecursionError):
            return None

    def _resolve(self, text: str) -> Sequence[int] | None:
        name, _, index = text.rstrip("]").partition("[")
        operand: Any = ast.Identifier(name)
        try:
            if index:
                operand = ast.IndexedIdentifier(operand, [[ast.IntegerLiteral(int(index))]])
            qubits = self._interpreter.qubits(operand)
        except (CircuitError, ValueError):
            return None
        if len(self._qubits) < _MAX_TEXTS:
            self._qubits[text] = qubits
        return qubits
