"""Gate statements expanded into gates of the table: definitions, calls and modifiers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import openqasm3
from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.ir import COUPLINGS, Angle, Gate
from qcompile.qasm.expressions import Scope, source_of
from qcompile.qasm.gates import require_count, standard
from qcompile.qasm.modifiers import Unitary
from qcompile.qasm.work import Work
from qcompile.qasm.write import DEFINITIONS

_MAX_INLINED, _MAX_INLINED_GATES = 10_000, 1_000
"""The most expanded calls of gates defined in the file that are cached, and gates in each."""

_WRITTEN = {
    name: {texts.get(name) for texts in DEFINITIONS.values()}
    for name in chain.from_iterable(DEFINITIONS.values())
}
"""How `write` defines gates of the table: a file with such a definition means the table's gate."""


class GateCalls:
    """The gates that a file can call: those of the table and those it defines.

    `scope` is that of the file. Expanded calls of the gates it defines are cached, because files
    repeat them often.
    """

    def __init__(self, scope: Scope, work: Work):
        self.left_out_barriers = False
        """Whether a barrier in a definition was left out."""
        self._scope, self._work = scope, work
        self._definitions: dict[str, Any] = {}
        self._opaque: set[str] = set()
        self._inlined: dict[tuple[Any, ...], Unitary] = {}
        self._active: list[str] = []

    def define(self, statement: Any) -> None:
        """Add a gate that the file defines.

        Raises:
            CircuitError: a name occurs twice in its header.
        """
        name = statement.name.name
        arguments = [a.name for a in statement.arguments]
        qubits = [q.name for q in statement.qubits]
        for names in (arguments, qubits):
            if len(set(names)) != len(names):
                raise CircuitError(f"Gate {name!r} uses a name twice in its header.")
        if not (
            name in _WRITTEN and " ".join(openqasm3.dumps(statement).split()) in _WRITTEN[name]
        ):
            self._definitions[name] = statement

    def define_opaque(self, name: str) -> None:
        """Add an opaque gate, which the file declares without defining it.

        Files declare ecr so, which no include has: it is known all the same.
        """
        if name not in COUPLINGS:
            self._opaque.add(name)

    def call(self, name: str, angles: Sequence[Angle], width: int) -> Unitary:
        """The gates of a call of gate `name` on `width` qubits.

        Raises:
            CircuitError: there is no such gate, or the number of angles or qubits is wrong.
        """
        if name in self._opaque:
            raise CircuitError(
                f"Gate {name!r} is opaque: the file does not define it.",
                f"Define it: gate {name} ... {{ ... }}",
            )
        if name in self._definitions:
            return self._inline(name, angles, width)
        unitary = standard(name, angles, list(self._definitions))
        require_count(name, unitary.width, width, "qubit")
        return unitary

    def expand(self, statement: Any, scope: Scope) -> Unitary:
        """The gates of a gate statement; its expressions are evaluated in `scope`.

        Raises:
            CircuitError: it is not a gate that can be compiled.
        """
        controls = self._controls(statement, scope)
        width = len(statement.qubits) - sum(controls)
        least = int(isinstance(statement, ast.QuantumGate))
        if width < least:
            raise CircuitError(
                f"{source_of(statement)} takes at least {sum(controls) + least} qubits, "
                f"found {len(statement.qubits)}.",
                "The controls come first, then the qubits of the gate.",
            )
        if isinstance(statement, ast.QuantumPhase):
            unitary = Unitary((), width, scope.evaluate(statement.argument))
        else:
            if statement.duration is not None:
                raise CircuitError(
                    f"{source_of(statement)} has a duration.", "Remove it: gates have none here."
                )
            angles = [scope.evaluate(argument) for argument in statement.arguments]
            unitary = self.call(statement.name.name, angles, width)
        for modifier, count in zip(reversed(statement.modifiers), reversed(controls), strict=True):
            unitary = self._modify(unitary, modifier, count, scope)
        return unitary

    def _controls(self, statement: Any, scope: Scope) -> list[int]:
        """How many controls each modifier of a statement adds."""
        counts = []
        for modifier in statement.modifiers:
            controls = 0
            if modifier.modifier.name in ("ctrl", "negctrl"):
                argument = modifier.argument
                controls = 1 if argument is None else scope.whole_number(argument)
                if controls < 1:
                    raise CircuitError(
                        f"{source_of(statement)} has {controls} controls.",
                        "A controlled gate has at least one.",
                    )
            counts.append(controls)
        return counts

    def _inline(self, name: str, angles: Sequence[Angle], width: int) -> Unitary:
        definition, line = self._definitions[name], self._work.line
        require_count(name, len(definition.arguments), len(angles), "angle")
        require_count(name, len(definition.qubits), width, "qubit")
        call = (name, *angles)
        if call in self._inlined:
            return self._inlined[call]
        if name in self._active:
            raise CircuitError(f"Gate {name!r} is defined by itself.")
        self._active.append(name)
        arguments = (argument.name for argument in definition.arguments)
        scope = self._scope.inner(dict(zip(arguments, angles, strict=True)))
        places = {qubit.name: index for index, qubit in enumerate(definition.qubits)}
        gates: list[Gate] = []
        phase = Angle()
        try:
            for statement in definition.body:
                self._work.line = statement.span.start_line
                self._work.step()
                operands = self._inner_operands(statement, places)
                if isinstance(statement, ast.QuantumBarrier):
                    self.left_out_barriers = True
                    continue
                inner = self.expand(statement, scope)
                phase += inner.phase
                qubits = [places[operand] for operand in operands]
                gates += inner.gates if qubits == [0] else _moved(inner.gates, qubits)
                self._work.require_room(len(gates))
        finally:
            self._active.pop()
        self._work.line = line
        unitary = Unitary(gates, width, phase)
        if len(self._inlined) < _MAX_INLINED and len(gates) <= _MAX_INLINED_GATES:
            self._inlined[call] = unitary
        return unitary

    def _inner_operands(self, statement: Any, qubits: Mapping[str, int]) -> list[str]:
        """The qubits of the gate that a statement of its body acts on."""
        if not isinstance(statement, ast.QuantumGate | ast.QuantumPhase | ast.QuantumBarrier):
            raise unsupported(statement)
        operands = [q.name if isinstance(q, ast.Identifier) else "" for q in statement.qubits]
        for operand in operands:
            if operand not in qubits:
                raise CircuitError(
                    f"{source_of(statement)!r} uses something that is not a qubit of the gate.",
                    f"The qubits of the gate: {', '.join(qubits)}.",
                )
        if len(set(operands)) != len(operands):
            raise CircuitError(f"{source_of(statement)} uses a qubit twice.")
        return operands

    def _modify(self, unitary: Unitary, modifier: Any, controls: int, scope: Scope) -> Unitary:
        room, name = self._work.require_room, modifier.modifier.name
        if name == "inv":
            return unitary.inverse()
        if name == "pow":
            power = scope.evaluate(modifier.argument)
            if not power.is_constant:
                raise CircuitError(f"{source_of(modifier.argument)!r} is not a constant.")
            return unitary.power(power.constant, room)
        return unitary.controlled(controls, on_one=name == "ctrl", room=room)


def _moved(gates: Sequence[Gate], qubits: Sequence[int]) -> list[Gate]:
    """The gates with qubit `qubits[k]` in the place of qubit k."""
    return [gate.on(*(qubits[qubit] for qubit in gate.qubits)) for gate in gates]


def unsupported(statement: Any) -> CircuitError:
    return CircuitError(
        f"The statement {source_of(statement)!r} is not supported.",
        "qcompile supports gates, barriers, and one measurement of each qubit at the end.",
    )
