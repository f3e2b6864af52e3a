"""Qiskit circuits of any gates as one IR circuit: runs, and what stands between them.

In the IR, an instruction that is no gate on one qubit is a coupling through which rotations about z
commute where they commute with the instruction: cx, cz and ecr themselves; cz for other diagonal
ones; for anything else, a cx on each of its qubits. Where such couplings need a second qubit, it is
one that the circuit does not have, the last. No pass that keeps the unitary drops or reorders
couplings, so that the instructions take their places again.

Source: qiskit.circuit, QuantumCircuit, ControlFlowOp and ParameterExpression.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.errors import CircuitError
from qcompile.interop.late.frames import Turn, frames
from qcompile.interop.late.operations import DIAGONAL, is_standard, with_angle
from qcompile.interop.qiskit import angle_of, definition_of
from qcompile.ir import COUPLINGS, Angle, Circuit, Gate, Program
from qcompile.ir.turns import reduced
from qcompile.qasm.gates import KNOWN_GATES, standard


@dataclass(frozen=True)
class Between:
    """An instruction between runs, the couplings that stand for it, and its open angle, if any."""

    instruction: Any
    couplings: int
    interaction: int | None = None


@dataclass
class Instructions:
    """The instructions of a circuit, in order.

    `program` has one circuit, with a qubit more than the source. Its inputs are `parameters`, then
    `expressions`, whose values are not affine in them, then two turns of each of the open
    `interactions`, whose rzz is folded into [0, pi/2] (`folded`).
    """

    parameters: tuple[Any, ...]
    expressions: list[Any] = field(default_factory=list)
    interactions: list[Angle] = field(default_factory=list)
    between: list[Between] = field(default_factory=list)
    gates: list[Gate] = field(default_factory=list)
    width: int = 0

    @property
    def symbols(self) -> tuple[str, ...]:
        """The symbols of parameters and expressions."""
        return tuple(
            f"{kind}{i}"
            for kind, members in (("p", self.parameters), ("e", self.expressions))
            for i in range(len(members))
        )

    @property
    def program(self) -> Program:
        turns = [f"{axis}{k}" for k in range(len(self.interactions)) for axis in "xz"]
        circuit = Circuit(tuple(self.gates), self.width + 1)
        return Program((circuit,), (*self.symbols, *turns))


def read_instructions(circuit: Any) -> Instructions:
    """The instructions of a QuantumCircuit.

    Raises:
        CircuitError: an angle is not real, or the circuit has no qubits.
    """
    if not circuit.num_qubits:
        raise CircuitError("The circuit has no qubits.", "Late binding needs gates on qubits.")
    reader = _Reader(circuit)
    for instruction in circuit.data:
        reader.add(instruction)
    return reader.found


def folded(angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """An angle of rzz as one in [0, pi/2], and turns by 0 or pi about x and about z.

    Up to global phase rzz(angle) is rzz of the first between two rx of the second on one of its
    qubits, then rz of the third on both: ZZ = i rzz(pi), and X on one qubit turns the sign.
    """
    angle = reduced(angle)
    halves = np.rint(angle / math.pi)
    rest = angle - halves * math.pi
    return np.abs(rest), np.where(rest < 0, math.pi, 0.0), math.pi * (halves % 2)


@dataclass(frozen=True)
class _Fold:
    """The turns of an rzz, and its angle in range, or the number of the open interaction."""

    about_x: Angle
    about_z: Angle
    inside: float = 0.0
    number: int | None = None


class _Reader:
    def __init__(self, circuit: Any):
        self.found = Instructions(tuple(circuit.parameters), width=circuit.num_qubits)
        self._circuit = circuit
        self._names = {p.name: f"p{i}" for i, p in enumerate(circuit.parameters)}
        self._angles: dict[Any, Angle] = {}
        self._frames = frames(circuit)
        of_rzz = (i.operation.params[0] for i in circuit.data if is_standard(i.operation, "rzz"))
        self._folds = [self._fold(self._angle(value)) for value in of_rzz]
        self._read = 0
        self._about_z: dict[int, list[Gate]] = {}  # the gates that wait for the end of a chain

    def add(self, instruction: Any) -> None:
        operation = instruction.operation
        qubits = tuple(self._circuit.find_bit(qubit).index for qubit in instruction.qubits)
        gates = self._gates(operation) if len(qubits) == 1 and not instruction.clbits else None
        if gates is not None:
            later = self._about_z.get(qubits[0], self.found.gates)
            later += [gate.on(qubits[0]) for gate in gates]
        elif is_standard(operation, "rzz"):
            self._interaction(instruction, qubits)
        elif not is_standard(operation, "global_phase"):
            self._between(instruction, qubits)

    def _gates(self, operation: Any) -> Sequence[Gate] | None:
        """The gates of an operation on one qubit; None if it is not made of gates."""
        if is_standard(operation, *KNOWN_GATES):
            angles = [self._angle(value) for value in operation.params]
            return [gate for gate, _ in standard(operation.name, angles).steps]
        definition = definition_of(operation)
        if definition is None or definition.num_clbits or definition.num_qubits != 1:
            return None
        parts = [self._gates(part.operation) for part in definition.data if part.qubits]
        return None if None in parts else [gate for part in parts for gate in part or ()]

    def _angle(self, value: Any) -> Angle:
        """The angle of a number or an expression; one that is not affine is a symbol of its own."""
        if not hasattr(value, "parameters"):
            return Angle.of(float(value))
        try:
            found = self._angles.get(value)
        except OverflowError:  # Qiskit cannot hash an expression that is a negative number
            return angle_of(value, self._names, products=False)
        if found is None:
            try:
                found = angle_of(value, self._names, products=False)
            except CircuitError:
                found = Angle.symbol(f"e{len(self.found.expressions)}")
                self.found.expressions.append(value)
            self._angles[value] = found
        return found

    def _fold(self, angle: Angle) -> _Fold:
        if angle.is_constant:
            inside, about_x, about_z = (float(v) for v in folded(np.array(angle.constant)))
            return _Fold(Angle(about_x), Angle(about_z), inside=inside)
        number = len(self.found.interactions)
        self.found.interactions.append(angle)
        return _Fold(Angle.symbol(f"x{number}"), Angle.symbol(f"z{number}"), number=number)

    def _turn(self, qubit: int, turn: Turn) -> None:
        angle = Angle()
        for rzz in sorted(turn):
            angle += self._folds[rzz].about_x
        if not angle.equals(0.0):
            self.found.gates.append(Gate("rx", angle, (qubit,)))

    def _interaction(self, instruction: Any, qubits: tuple[int, ...]) -> None:
        """An rzz, with its turns, and those of the chains that begin or end with it.

        Rotations about z within a chain that is turned wait for its end: they commute with rzz.
        """
        rzz, fold = self._read, self._folds[self._read]
        self._read += 1
        for qubit, turn in zip(qubits, self._frames.begins(rzz), strict=True):
            if turn:
                self._turn(qubit, turn)
                self._about_z[qubit] = []
        turned, alone = qubits[self._frames.turned(rzz)], self._frames.alone[rzz]
        self._turn(turned, alone)
        self.found.gates.append(Gate("cz", None, qubits))
        self._turn(turned, alone)
        if not fold.about_z.equals(0.0):
            self.found.gates += [Gate("rz", fold.about_z, (qubit,)) for qubit in qubits]
        for qubit, turn in zip(qubits, self._frames.ends(rzz), strict=True):
            if turn:
                self._turn(qubit, turn)
                self.found.gates += self._about_z.pop(qubit)
        if fold.number is None:
            instruction = with_angle(instruction, fold.inside)
        self.found.between.append(Between(instruction, 1, fold.number))

    def _between(self, instruction: Any, qubits: tuple[int, ...]) -> None:
        operation, other = instruction.operation, self.found.width
        if is_standard(operation, *COUPLINGS):
            couplings = [Gate(operation.name, None, qubits)]
        else:
            stops = "cz" if is_standard(operation, *DIAGONAL) else "cx"
            of = qubits or range(other)  # without qubits: about bits or variables, in this order
            couplings = [Gate(stops, None, (other, qubit)) for qubit in of]
        self.found.gates += couplings
        self.found.between.append(Between(instruction, len(couplings)))
