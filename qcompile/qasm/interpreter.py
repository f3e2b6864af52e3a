"""The statements of a parsed program file, run into circuits."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence, Set
from itertools import chain
from typing import Any

import openqasm3
from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.ir import Angle, Circuit, Gate, Program
from qcompile.qasm.blocks import Blocks
from qcompile.qasm.expressions import Scope, shown
from qcompile.qasm.gates import ENTANGLING_GATES, lacking_phase, require_count, standard
from qcompile.qasm.grammar import OpaqueGate, UnreadSubroutine
from qcompile.qasm.layout import Layout
from qcompile.qasm.marks import Mark
from qcompile.qasm.modifiers import Unitary
from qcompile.qasm.registers import Kind, Reference, Registers
from qcompile.qasm.variables import Variables
from qcompile.qasm.write import DEFINITIONS

MOST_GATES = 1_000_000
"""Gates of all circuits. Nested definitions double with every line; more are not written out."""

MOST_MARKED = 4_000_000
"""Qubits of all resets, barriers, delays and aliases together."""

_MOST_INLINED, _MOST_INLINED_GATES = 10_000, 1_000
"""Calls of the file's own gates that are kept written out, and the gates of each."""

_INCLUDES = ("stdgates.inc", "qelib1.inc", "hqslib1.inc")
_COUNTS = {2: "two", 3: "three", 4: "four", 5: "five"}
_WRITTEN = {
    name: {texts.get(name) for texts in DEFINITIONS.values()}
    for name in chain.from_iterable(DEFINITIONS.values())
}
"""How `write` defines gates of the table: a file that does it so means the table's gate."""


class Interpreter:
    """Runs the statements of a file, one by one; `line` is the line it is at.

    `version` is that of the file, "2" or "3". `joining_later` counts the statements still to come
    that join qubits, for a message. Whatever cannot be compiled is a CircuitError without the line.
    """

    def __init__(self, version: str | None, joining_later: Callable[[], int] = lambda: 0):
        self.line = 1
        self.entangling = set(ENTANGLING_GATES)
        """The names of all gates, standard or the file's own, that join qubits."""
        self._joining_later = joining_later
        self._is_2 = version == "2"
        self._variables = Variables(real=self._is_2)
        self._scope = self._variables.scope
        self._registers = Registers()
        self._definitions: dict[str, Any] = {}
        self._opaque: set[str] = set()
        self._inlined: dict[tuple[Any, ...], Unitary] = {}
        self._active: list[str] = []
        self._declared: set[str] = set()
        self._gates: defaultdict[int, list[Gate]] = defaultdict(list)
        self._bit_of: dict[int, int | None] = {}
        self._written_by: dict[int, int] = {}
        self._again: dict[tuple[int, int], None] = {}
        self._marks: list[Mark] = []
        self._marked = 0
        self._durations: dict[str, str] = {}
        self._barrier_in_gate = False
        self._room = self._steps = MOST_GATES
        self._blocks = Blocks(
            self._variables, self._registers, self._declared, self._run, self._step
        )

    def finish(self) -> tuple[Program, Layout, tuple[Mark, ...]]:
        """The program, its layout and its marks, behind the last statement."""
        layout = self._registers.layout(self._bit_of, list(self._again))
        if not layout.qubits:
            raise CircuitError("The program has no qubits.", "Declare some, such as: qubit[2] q;")
        circuits = tuple(Circuit(tuple(self._gates.pop(i, ()))) for i in range(len(layout)))
        return Program(circuits, tuple(self._variables.inputs)), layout, tuple(self._marks)

    def notes(self) -> tuple[str, ...]:
        """What of the file is in no circuit and no mark."""
        if not self._barrier_in_gate:
            return ()
        return ("barriers within gate definitions are left out.",)

    def run(self, statement: Any) -> None:
        """Run one statement."""
        self._run(statement)

    def evaluate(self, expression: Any) -> Angle:
        """The angle that an expression stands for."""
        return self._scope.evaluate(expression)

    def call(self, name: str, angles: Sequence[Angle], width: int) -> Unitary:
        """What gate `name` does to its `width` qubits."""
        if name in self._opaque:
            raise CircuitError(
                f"Gate {name!r} is opaque: the file does not say what it does.",
                f"Define it: gate {name} ... {{ ... }}",
            )
        if name in self._definitions:
            return self._inline(name, angles, width)
        gates = standard(name, angles, list(self._definitions))
        require_count(name, 1, width, "qubit")
        return Unitary([gates], lacking_phase(name, angles), is_standard=True)

    def qubits(self, operand: Any) -> Sequence[int]:
        """The positions of the qubits that an operand names, now and ever after."""
        return self._resolve(operand, "qubit").positions

    def append(self, gates: Sequence[Gate], qubits: Sequence[int]) -> bool:
        """Put `gates` on each of `qubits`, unless one of them is measured already."""
        for qubit in qubits:
            if qubit in self._bit_of:
                return False
        needed = len(gates) * len(qubits)
        self._require_room(needed)
        self._room -= needed
        for qubit in qubits:
            self._gates[qubit] += gates
        return True

    def _run(self, statement: Any) -> None:
        self.line = statement.span.start_line
        match statement:
            case ast.Include():
                if statement.filename not in _INCLUDES:
                    raise CircuitError(
                        f"The include {statement.filename!r} is not known.",
                        f"Known: {', '.join(_INCLUDES)}. Copy what it defines into this file.",
                    )
            case ast.QubitDeclaration():
                self._declare_register("qubit", statement.qubit, statement.size)
            case ast.ClassicalDeclaration(type=ast.BitType()):
                self._declare_register("bit", statement.identifier, statement.type.size)
                if isinstance(statement.init_expression, ast.QuantumMeasurement):
                    self._measure(statement.init_expression, statement.identifier)
                elif statement.init_expression is not None:
                    self._require_zeros(statement)
            case ast.ClassicalDeclaration() if type := self._scope.type_of(statement.type):
                name = self._declare(statement.identifier.name)
                self._variables.declare(name, type, statement.init_expression)
            case ast.ClassicalAssignment(lvalue=ast.Identifier()):
                self._variables.assign(statement.lvalue.name, statement.op.name, statement.rvalue)
            case ast.IODeclaration(type=ast.BitType()) if statement.io_identifier.name == "output":
                self._declare_register("bit", statement.identifier, statement.type.size)
            case ast.IODeclaration(type=ast.FloatType() | ast.AngleType()) if (
                statement.io_identifier.name == "input"
            ):
                self._variables.input(self._declare(statement.identifier.name))
            case ast.ConstantDeclaration() if type := self._scope.type_of(statement.type):
                name = self._declare(statement.identifier.name)
                self._variables.constant(name, type, statement.init_expression)
            case ast.AliasStatement():
                name = self._declare(statement.target.name)
                reference = self._resolve(statement.value)
                self._count(len(reference.positions))
                self._registers.alias(name, reference)
            case ast.QuantumGateDefinition():
                self._define(statement)
            case ast.ForInLoop():
                self._blocks.loop(statement)
            case ast.BranchingStatement() if self._blocks.branch(statement):
                pass
            case ast.Box(duration=None):
                self._blocks.body(statement.body)
            case ast.SubroutineDefinition() | UnreadSubroutine():
                name = self._declare(statement.name.name)
                unread = isinstance(statement, UnreadSubroutine)
                self._blocks.define(name, None if unread else statement)
            case ast.ExpressionStatement(expression=ast.FunctionCall() as call) if (
                self._blocks.knows(call.name.name)
            ):
                self._blocks.call(call)
            case OpaqueGate():
                self._opaque.add(self._declare(statement.name.name))
            case ast.QuantumGate() | ast.QuantumPhase() if joins(statement, self.entangling):
                raise self._entangles(statement)
            case ast.QuantumGate() | ast.QuantumPhase():
                self._apply(statement)
            case ast.QuantumBarrier():
                self._mark("barrier", statement.qubits)
            case ast.DelayInstruction() if text := self._duration(statement.duration):
                self._mark(f"delay[{text}]", statement.qubits)
            case ast.ConstantDeclaration() | ast.ClassicalDeclaration() if isinstance(
                statement.type, ast.DurationType
            ) and (text := self._duration(statement.init_expression)):
                self._durations[self._declare(statement.identifier.name)] = text
            case ast.QuantumReset():
                self._reset(statement)
            case ast.QuantumMeasurementStatement():
                self._measure(statement.measure, statement.target)
            case _:
                raise _unsupported(statement)

    def _declare(self, name: str) -> str:
        if name in self._declared:
            raise CircuitError(f"{name!r} is declared twice.")
        self._declared.add(name)
        return name

    def _declare_register(self, kind: Kind, identifier: Any, size: Any) -> None:
        name = self._declare(identifier.name)
        least = 0 if self._is_2 and kind == "bit" else 1
        self._registers.declare(kind, name, size and self._scope.whole_number(size), least)

    def _require_zeros(self, statement: Any) -> None:
        """Raise CircuitError unless bits are set to 0, which is what they are before measured."""
        value = self._scope.value(statement.init_expression)
        if value.number not in (0, Angle()):
            raise CircuitError(
                f"{shown(statement)} sets bits to 1.",
                "Bits that are not measured stay 0 here.",
            )

    def _resolve(self, operand: Any, kind: Kind | None = None) -> Reference:
        return self._registers.resolve(operand, self._scope, kind)

    def note_entangling(self, definition: Any) -> None:
        """Know whether the gate that is defined joins qubits."""
        if any(joins(inner, self.entangling) for inner in definition.body):
            self.entangling.add(definition.name.name)
        else:
            self.entangling.discard(definition.name.name)

    def _define(self, statement: Any) -> None:
        name = self._declare(statement.name.name)
        self.note_entangling(statement)
        arguments = [a.name for a in statement.arguments]
        qubits = [q.name for q in statement.qubits]
        for names in (arguments, qubits):
            if len(set(names)) != len(names):
                raise CircuitError(f"Gate {name!r} uses one name twice in its head.")
        if not (
            name in _WRITTEN and " ".join(openqasm3.dumps(statement).split()) in _WRITTEN[name]
        ):
            self._definitions[name] = statement

    def _entangles(self, statement: Any) -> CircuitError:
        swaps = isinstance(statement, ast.QuantumGate) and statement.name.name == "swap"
        verb = "exchanges" if swaps and not statement.modifiers else "entangles"
        width = max(2, len(statement.qubits))
        count = 1 + self._joining_later()
        return CircuitError(
            f"{shown(statement)} {verb} {_COUNTS.get(width, width)} qubits.",
            f"qcompile compiles circuits without entangling gates; this one has {count}.",
            "Compile it with Qiskit's transpile, or remove the gate.",
        )

    def _apply(self, statement: Any) -> None:
        parts = self._expand(statement, self._scope).parts
        operands = [self._resolve(qubit, "qubit") for qubit in statement.qubits]
        sizes = {len(operand.positions) for operand in operands if not operand.single}
        if len(sizes) > 1:
            raise CircuitError(
                f"{shown(statement)} joins registers of {' and '.join(map(str, sorted(sizes)))}.",
                "Registers that a gate is spread over need one size.",
            )
        for repetition in range(sizes.pop() if sizes else 1):
            targets = [o.positions[0 if o.single else repetition] for o in operands]
            if len(set(targets)) != len(targets):
                raise CircuitError(f"{shown(statement)} uses a qubit twice.")
            for target, gates in zip(targets, parts, strict=True):
                if not self.append(gates, (target,)):
                    raise self._measured_before(target, statement)

    def _expand(self, statement: Any, scope: Scope) -> Unitary:
        """What a gate statement does to its operands."""
        if isinstance(statement, ast.QuantumPhase):
            phase = scope.evaluate(statement.argument)
            unitary = Unitary([[] for _ in statement.qubits], phase)
        else:
            if statement.duration is not None:
                raise CircuitError(f"{shown(statement)} has a duration.", "Gates take none here.")
            angles = [scope.evaluate(argument) for argument in statement.arguments]
            unitary = self.call(statement.name.name, angles, len(statement.qubits))
        for modifier in reversed(statement.modifiers):
            unitary = self._modify(unitary, modifier, statement, scope)
        return unitary

    def _inline(self, name: str, angles: Sequence[Angle], width: int) -> Unitary:
        definition, line = self._definitions[name], self.line
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
                self.line = statement.span.start_line
                self._step()
                operands = self._inner_operands(statement, parts)
                if isinstance(statement, ast.QuantumBarrier):
                    self._barrier_in_gate = True
                    continue
                inner = self._expand(statement, scope)
                phase += inner.phase
                for operand, gates in zip(operands, inner.parts, strict=True):
                    parts[operand] += gates
                    self._require_room(len(parts[operand]))
        finally:
            self._active.pop()
        self.line = line
        made = Unitary(list(parts.values()), phase)
        if len(self._inlined) < _MOST_INLINED and made.size <= _MOST_INLINED_GATES:
            self._inlined[call] = made
        return made

    def _inner_operands(self, statement: Any, parts: Mapping[str, object]) -> list[str]:
        """The qubits of the gate that a statement of its body acts on."""
        if not isinstance(statement, ast.QuantumGate | ast.QuantumPhase | ast.QuantumBarrier):
            raise _unsupported(statement)
        operands = [q.name if isinstance(q, ast.Identifier) else "" for q in statement.qubits]
        for operand in operands:
            if operand not in parts:
                raise CircuitError(
                    f"{shown(statement)!r} names what is no qubit of the gate.",
                    f"The gate has {', '.join(parts)}.",
                )
        if len(set(operands)) != len(operands):
            raise CircuitError(f"{shown(statement)} uses a qubit twice.")
        return operands

    def _modify(self, unitary: Unitary, modifier: Any, statement: Any, scope: Scope) -> Unitary:
        name = modifier.modifier.name
        if name == "inv":
            return unitary.inverse()
        if name == "pow":
            power = scope.evaluate(modifier.argument)
            if not power.is_constant:
                raise CircuitError(f"{shown(modifier.argument)!r} is no constant.")
            multiple = unitary.multiple(power.constant)
            if multiple is None and power.constant.is_integer():
                self._require_room(unitary.size * int(abs(power.constant)))
            return multiple or unitary.power(power.constant)
        controls = 1 if modifier.argument is None else scope.whole_number(modifier.argument)
        if (
            controls != 1
            or len(statement.qubits) != 1
            or not isinstance(statement, ast.QuantumPhase)
            or unitary.size
        ):
            raise CircuitError(
                f"{shown(statement)}: {name} @ needs a qubit more than the gate.",
                "Only that of gphase is a gate on one qubit.",
            )
        return unitary.controlled(on_one=name == "ctrl")

    def _mark(self, text: str, operands: Sequence[Any]) -> None:
        """Note a statement on these operands, or on every qubit."""
        named = [q for operand in operands for q in self._resolve(operand, "qubit").positions]
        qubits = tuple(dict.fromkeys(named if operands else self._registers.every_qubit))
        measured, gates_of = self._bit_of, self._gates.get
        gates = [None if qubit in measured else len(gates_of(qubit, ())) for qubit in qubits]
        self._keep(Mark(text, qubits, tuple(gates)))

    def _keep(self, mark: Mark) -> None:
        self._marks.append(mark)
        self._count(len(mark.circuits))

    def _count(self, qubits: int) -> None:
        self._marked += qubits
        if self._marked > MOST_MARKED:
            raise CircuitError(
                f"Resets, barriers, delays and aliases name more than {MOST_MARKED} qubits in all.",
                "Remove some of them, or name fewer qubits in each.",
            )

    def _duration(self, expression: Any) -> str | None:
        """A duration as text: a number with its unit, or what was declared as one."""
        match expression:
            case ast.DurationLiteral() if math.isfinite(expression.value):
                return f"{expression.value:.15g}{expression.unit.name}"
            case ast.Identifier():
                return self._durations.get(expression.name)
        return None

    def _reset(self, statement: Any) -> None:
        for qubit in self._resolve(statement.qubits, "qubit").positions:
            if self._gates[qubit] or qubit in self._bit_of:
                raise CircuitError(
                    f"{shown(statement)} comes after a gate or a measurement of its qubit.",
                    "qcompile compiles circuits that start in |0>; a reset can only come first.",
                )
            self._keep(Mark("reset", (qubit,), (0,)))

    def _measure(self, measurement: Any, target: Any) -> None:
        qubits = self._resolve(measurement.qubit, "qubit")
        bits = None if target is None else self._resolve(target, "bit")
        if bits is not None and len(bits.positions) != len(qubits.positions):
            raise CircuitError(
                f"{len(qubits.positions)} qubits are measured into {len(bits.positions)} bits.",
                "A measurement needs one bit for each qubit.",
            )
        for index, qubit in enumerate(qubits.positions):
            self._measure_one(qubit, None if bits is None else bits.positions[index])

    def _measure_one(self, qubit: int, bit: int | None) -> None:
        """Measure a qubit; one that is measured already has the same value still."""
        before = self._bit_of.setdefault(qubit, bit)
        if bit is None:
            return
        if self._written_by.setdefault(bit, qubit) != qubit:
            raise CircuitError(
                f"{self._registers.name('bit', bit)} is written twice.",
                "Measure every qubit into a bit of its own.",
            )
        if before is None:
            self._bit_of[qubit] = bit
        elif bit != before:
            self._again[qubit, bit] = None

    def _measured_before(self, qubit: int, statement: Any) -> CircuitError:
        name = self._registers.name("qubit", qubit)
        return CircuitError(
            f"{shown(statement)} follows the measurement of {name}.",
            "qcompile measures every qubit once, at the end.",
        )

    def _require_room(self, gates: int) -> None:
        if gates > self._room:
            raise CircuitError(
                f"The program has more than {MOST_GATES} gates when it is written out.",
                "Check its nested gate definitions and powers.",
            )

    def _step(self) -> None:
        """Count a statement of a body: those without gates double too."""
        self._steps -= 1
        if self._steps < 0:
            raise CircuitError(
                f"Definitions and loops take more than {MOST_GATES} statements to write out.",
                "Check those that nest.",
            )


def joins(statement: Any, entangling: Set[str]) -> bool:
    """Whether a statement is a gate on several qubits at once."""
    if not isinstance(statement, ast.QuantumGate | ast.QuantumPhase):
        return False
    controlled = any(m.modifier.name in ("ctrl", "negctrl") for m in statement.modifiers)
    if controlled and len(statement.qubits) > 1:
        return True
    return isinstance(statement, ast.QuantumGate) and statement.name.name in entangling


def _unsupported(statement: Any) -> CircuitError:
    return CircuitError(
        f"The statement {shown(statement)!r} is not supported.",
        "qcompile reads gates, barriers, and one measurement of each qubit at the end.",
    )
