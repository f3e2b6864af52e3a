"""Gate statements expanded into gates of the table: definitions, calls and modifiers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from itertools import chain
from typing import Any

import openqasm3
from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.ir import Angle, Gate
from qcompile.qasm.expressions import Scope, source_of
from qcompile.qasm.gates import ENTANGLING_GATES, lacking_phase, require_count, standard
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
        self.entangling = set(ENTANGLING_GATES)
        """The names of all gates, standard or defined in the file, that entangle qubits."""
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
        self.note_entangling(statement)
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
        """Add an opaque gate, which the file declares without defining it."""
        self._opaque.add(name)

    def note_entangling(self, definition: Any) -> None:
        """Record whether the gate that is defined entangles qubits."""
        if any(is_entangling(inner, self.entangling) for inner in definition.body):
            self.entangling.add(definition.name.name)
        else:
            self.entangling.discard(definition.name.name)

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
        gates = standard(name, angles, list(self._definitions))
        require_count(name, 1, width, "qubit")
        return Unitary([gates], lacking_phase(name, angles), is_standard=True)

    def expand(self, statement: Any, scope: Scope) -> Unitary:
        """The gates of a gate statement; its expressions are evaluated in `scope`.

        Raises:
            CircuitError: it is not a gate that can be compiled.
        """
        if isinstance(statement, ast.QuantumPhase):
            phase = scope.evaluate(statement.argument)
            unitary = Unitary([[] for _ in statement.qubits], phase)
        else:
            if statement.duration is not None:
                raise CircuitError(
                    f"{source_of(statement)} has a duration.", "Remove it: gates have none here."
                )
            angles = [scope.evaluate(argument) for argument in statement.arguments]
            unitary = self.call(statement.name.name, angles, len(statement.qubits))
        for modifier in reversed(statement.modifiers):
            unitary = self._modify(unitary, modifier, statement, scope)
        return unitary

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
        parts: dict[str, list[Gate]] = {qubit.name: [] for qubit in definition.qubits}
        phase = Angle()
        try:
            for statement in definition.body:
                self._work.line = statement.span.start_line
                self._work.step()
                operands = self._inner_operands(statement, parts)
                if isinstance(statement, ast.QuantumBarrier):
                    self.left_out_barriers = True
                    continue
                inner = self.expand(statement, scope)
                phase += inner.phase
                for operand, gates in zip(operands, inner.parts, strict=True):
                    parts[operand] += gates
                    self._work.require_room(len(parts[operand]))
        finally:
            self._active.pop()
        self._work.line = line
        unitary = Unitary(list(parts.values()), phase)
        if len(self._inlined) < _MAX_INLINED and unitary.size <= _MAX_INLINED_GATES:
            self._inlined[call] = unitary
        return unitary

    def _inner_operands(self, statement: Any, parts: Mapping[str, object]) -> list[str]:
        """The qubits of the gate that a statement of its body acts on."""
        if not isinstance(statement, ast.QuantumGate | ast.QuantumPhase | ast.QuantumBarrier):
            raise unsupported(statement)
        operands = [q.name if isinstance(q, ast.Identifier) else "" for q in statement.qubits]
        for operand in operands:
            if operand not in parts:
                raise CircuitError(
                    f"{source_of(statement)!r} uses something that is not a qubit of the gate.",
                    f"The qubits of the gate: {', '.join(parts)}.",
                )
        if len(set(operands)) != len(operands):
            raise CircuitError(f"{source_of(statement)} uses a qubit twice.")
        return operands

    def _modify(self, unitary: Unitary, modifier: Any, statement: Any, scope: Scope) -> Unitary:
        name = modifier.modifier.name
        if name == "inv":
            return unitary.inverse()
        if name == "pow":
            power = scope.evaluate(modifier.argument)
            if not power.is_constant:
                raise CircuitError(f"{source_of(modifier.argument)!r} is not a constant.")
            multiple = unitary.multiple(power.constant)
            if multiple is None and power.constant.is_integer():
                self._work.require_room(unitary.size * int(abs(power.constant)))
            return multiple or unitary.power(power.constant)
        controls = 1 if modifier.argument is None else scope.whole_number(modifier.argument)
        if (
            controls != 1
            or len(statement.qubits) != 1
            or not isinstance(statement, ast.QuantumPhase)
            or unitary.size
        ):
            raise CircuitError(
                f"{source_of(statement)}: {name} @ makes a gate on more than one qubit.",
                "Only a controlled gphase acts on a single qubit.",
            )
        return unitary.controlled(on_one=name == "ctrl")


def is_entangling(statement: Any, entangling: Set[str]) -> bool:
    """Whether a statement is a gate on several qubits at once."""
    if not isinstance(statement, ast.QuantumGate | ast.QuantumPhase):
        return False
    controlled = any(m.modifier.name in ("ctrl", "negctrl") for m in statement.modifiers)
    if controlled and len(statement.qubits) > 1:
        return True
    return isinstance(statement, ast.QuantumGate) and statement.name.name in entangling


def unsupported(statement: Any) -> CircuitError:
    return CircuitError(
        f"The statement {source_of(statement)!r} is not supported.",
        "qcompile supports gates, barriers, and one measurement of each qubit at the end.",
    )
