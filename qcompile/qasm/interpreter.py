"""Runs the statements of a parsed program file, which gives the circuits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from openqasm3 import ast

from qcompile.errors import CircuitError
from qcompile.ir import Angle, Gate, Program
from qcompile.ir.products import separated
from qcompile.ir.wires import Step, Wires
from qcompile.qasm.blocks import Blocks
from qcompile.qasm.calls import GateCalls, unsupported
from qcompile.qasm.expressions import source_of
from qcompile.qasm.grammar import OpaqueGate, UnreadSubroutine
from qcompile.qasm.layout import Layout
from qcompile.qasm.marks import Mark
from qcompile.qasm.registers import Reference, RegisterKind, Registers
from qcompile.qasm.variables import Variables
from qcompile.qasm.work import Work

MAX_MARKED = 4_000_000
"""The most qubits in all resets, barriers, delays and aliases together."""

_INCLUDES = ("stdgates.inc", "qelib1.inc", "hqslib1.inc")


class Interpreter:
    """Runs the statements of a file, one by one; `gates` are the gates that it can call.

    `version` is that of the file, "2" or "3". With `products` an angle may contain products of two
    inputs, which become inputs of the program; `products` then holds both factors of each. What
    cannot be compiled raises a CircuitError without the line.
    """

    def __init__(self, version: str | None, products: bool):
        self._is_2 = version == "2"
        self._variables = Variables(real=self._is_2, products=products)
        self.products: dict[str, tuple[str, str]] = {}
        self._scope = self._variables.scope
        self._work = Work()
        self.gates = GateCalls(self._scope, self._work)
        self._registers = Registers()
        self._declared: dict[str, None] = {}
        self._wires = Wires()
        self._bit_of: dict[int, int | None] = {}
        self._written_by: dict[int, int] = {}
        self._again: dict[tuple[int, int], None] = {}
        self._marks: list[Mark] = []
        self._marked = 0
        self._durations: dict[str, str] = {}
        self._blocks = Blocks(
            self._variables, self._registers, self._declared, self.run, self._work.step
        )

    def finish(self) -> tuple[Program, Layout, tuple[Mark, ...], tuple[int, ...]]:
        """The program, its layout, its marks and the qubit of each bit, at the end of the file."""
        count = len(self._registers.every_qubit)
        if not count:
            raise CircuitError("The program has no qubits.", "Declare qubits: qubit[2] q;")
        circuits, qubits = self._wires.circuits(count)
        layout = self._registers.layout(qubits, self._bit_of, list(self._again))
        marks = tuple(self._marks)
        if len(circuits) < count:
            bits = {qubit: bit for bit, qubit in enumerate(qubits)}
            marks = tuple(replace(m, bits=tuple(bits[q] for q in m.bits)) for m in marks)
        inputs = self._variables.inputs
        if self._scope.products:
            circuits, self.products = separated(circuits, inputs)
        return Program(circuits, (*inputs, *self.products)), layout, marks, qubits

    def notes(self) -> tuple[str, ...]:
        """Notes on parts of the file that were left out."""
        if not self.gates.left_out_barriers:
            return ()
        return ("barriers within gate definitions are left out.",)

    @property
    def line(self) -> int:
        """The line of the current statement."""
        return self._work.line

    def evaluate(self, expression: Any) -> Angle:
        """The value of an expression as an angle."""
        return self._scope.evaluate(expression)

    def qubits(self, operand: Any) -> Sequence[int]:
        """The positions of the qubits of an operand, which never change."""
        return self._resolve(operand, "qubit").positions

    def append(self, gates: Sequence[Gate], qubits: Sequence[int]) -> bool:
        """Append `gates` to each of `qubits`; False if one of them is measured already."""
        for qubit in qubits:
            if qubit in self._bit_of:
                return False
        self._work.take_room(len(gates) * len(qubits))
        for qubit in qubits:
            self._wires.gates[qubit] += gates
        return True

    def apply(self, steps: Sequence[Step], qubits: Sequence[int]) -> int | None:
        """Append the steps of a gate on `qubits`; the qubit that is measured already, if one is."""
        for qubit in qubits:
            if qubit in self._bit_of:
                return qubit
        self._work.take_room(len(steps))
        self._wires.apply(steps, qubits)
        return None

    def run(self, statement: Any) -> None:
        """Run one statement."""
        self._work.line = statement.span.start_line
        match statement:
            case ast.Include():
                if statement.filename not in _INCLUDES:
                    raise CircuitError(
                        f"Unknown include {statement.filename!r}.",
                        f"Known: {', '.join(_INCLUDES)}. Copy its definitions into this file.",
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
                self._declare(statement.name.name)
                self.gates.define(statement)
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
                self.gates.define_opaque(self._declare(statement.name.name))
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
                raise unsupported(statement)

    def _declare(self, name: str) -> str:
        if name in self._declared:
            raise CircuitError(f"{name!r} is declared twice.")
        self._declared[name] = None
        return name

    def _declare_register(self, kind: RegisterKind, identifier: Any, size: Any) -> None:
        name = self._declare(identifier.name)
        least = 0 if self._is_2 and kind == "bit" else 1
        self._registers.declare(kind, name, size and self._scope.whole_number(size), least)

    def _require_zeros(self, statement: Any) -> None:
        """Raise CircuitError unless bits are set to 0, their value before any measurement."""
        value = self._scope.value(statement.init_expression)
        if value.number not in (0, Angle()):
            raise CircuitError(
                f"{source_of(statement)} sets bits to 1.",
                "Bits can only be set to 0, or by a measurement.",
            )

    def _resolve(self, operand: Any, kind: RegisterKind | None = None) -> Reference:
        return self._registers.resolve(operand, self._scope, kind)

    def _apply(self, statement: Any) -> None:
        steps = self.gates.expand(statement, self._scope).steps
        operands = [self._resolve(qubit, "qubit") for qubit in statement.qubits]
        sizes = {len(operand.positions) for operand in operands if not operand.single}
        if len(sizes) > 1:
            listed = " and ".join(map(str, sorted(sizes)))
            raise CircuitError(
                f"{source_of(statement)} uses registers of different sizes: {listed}.",
                "Registers in one gate statement must have the same size.",
            )
        for repetition in range(sizes.pop() if sizes else 1):
            targets = [o.positions[0 if o.single else repetition] for o in operands]
            if len(set(targets)) != len(targets):
                raise CircuitError(f"{source_of(statement)} uses a qubit twice.")
            if (measured := self.apply(steps, targets)) is not None:
                raise self._measured_before(measured, statement)

    def _mark(self, text: str, operands: Sequence[Any]) -> None:
        """Add a mark for a statement on these operands, or on every qubit."""
        named = [q for operand in operands for q in self._resolve(operand, "qubit").positions]
        qubits = tuple(dict.fromkeys(named if operands else self._registers.every_qubit))
        measured, gates_of = self._bit_of, self._wires.gates.get
        gates = [None if qubit in measured else len(gates_of(qubit, ())) for qubit in qubits]
        self._keep(Mark(text, qubits, tuple(gates)))

    def _keep(self, mark: Mark) -> None:
        self._marks.append(mark)
        self._count(len(mark.bits))

    def _count(self, qubits: int) -> None:
        self._marked += qubits
        if self._marked > MAX_MARKED:
            raise CircuitError(
                f"Resets, barriers, delays and aliases name more than {MAX_MARKED} qubits in all.",
                "Remove some of them, or name fewer qubits in each.",
            )

    def _duration(self, expression: Any) -> str | None:
        """A duration as text: a number with its unit, or a declared duration."""
        match expression:
            case ast.DurationLiteral() if math.isfinite(expression.value):
                return f"{expression.value:.15g}{expression.unit.name}"
            case ast.Identifier():
                return self._durations.get(expression.name)
        return None

    def _reset(self, statement: Any) -> None:
        for qubit in self._resolve(statement.qubits, "qubit").positions:
            if self._wires.gates[qubit] or qubit in self._bit_of:
                raise CircuitError(
                    f"{source_of(statement)} comes after a gate or a measurement of its qubit.",
                    "qcompile compiles circuits that start in |0>; a reset can only come first.",
                )
            self._keep(Mark("reset", (qubit,), (0,)))

    def _measure(self, measurement: Any, target: Any) -> None:
        qubits = self._resolve(measurement.qubit, "qubit")
        bits = None if target is None else self._resolve(target, "bit")
        if bits is not None and len(bits.positions) != len(qubits.positions):
            raise CircuitError(
                f"{len(qubits.positions)} qubits are measured into {len(bits.positions)} bits.",
                "A measurement needs one bit per qubit.",
            )
        for index, qubit in enumerate(qubits.positions):
            self._measure_one(qubit, None if bits is None else bits.positions[index])

    def _measure_one(self, qubit: int, bit: int | None) -> None:
        """Measure a qubit; measuring it again at once gives the same value."""
        before = self._bit_of.setdefault(qubit, bit)
        if bit is None:
            return
        if self._written_by.setdefault(bit, qubit) != qubit:
            raise CircuitError(
                f"{self._registers.name('bit', bit)} is written twice.",
                "Measure each qubit into a separate bit.",
            )
        if before is None:
            self._bit_of[qubit] = bit
        elif bit != before:
            self._again[qubit, bit] = None

    def _measured_before(self, qubit: int, statement: Any) -> CircuitError:
        name = self._registers.name("qubit", qubit)
        return CircuitError(
            f"{source_of(statement)} follows the measurement of {name}.",
            "qcompile measures every qubit once, at the end.",
        )
