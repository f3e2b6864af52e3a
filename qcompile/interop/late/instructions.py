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
from qcompile.interop.qiskit import STANDARD_GATES, _angle, _definition
from qcompile.ir import COUPLINGS, Angle, Circuit, Gate, Program
from qcompile.ir.turns import reduced
from qcompile.qasm.gates import KNOWN_GATES, standard

_DIAGONAL = ("measure", "barrier", "delay", "rzz", "cp", "crz", "cu1")
"""Instructions that commute with rotations about z of their qubits."""
_MODULES = (STANDARD_GATES, *(f"qiskit.circuit.{name}" for name in ("measure", "barrier", "delay")))
"""The modules of the operations whose names say what they do."""
_VIRTUAL = ("rz", "p", "z", "s", "sdg", "t", "tdg", "id", "u1", "barrier")
"""Instructions without a pulse, which leave the run before them open."""


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
    for position, instruction in enumerate(circuit.data):
        reader.add(position, instruction)
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


def with_angle(instruction: Any, angle: Any) -> Any:
    """An rzz instruction with another angle, and its label."""
    operation = instruction.operation
    return instruction.replace(operation=type(operation)(angle, label=operation.label))


class _Reader:
    def __init__(self, circuit: Any):
        self.found = Instructions(tuple(circuit.parameters), width=circuit.num_qubits)
        self._circuit = circuit
        self._names = {p.name: f"p{i}" for i, p in enumerate(circuit.parameters)}
        self._angles: dict[Any, Angle] = {}
        self._pulsed = _pulsed_neighbours(circuit)

    def add(self, position: int, instruction: Any) -> None:
        operation = instruction.operation
        qubits = tuple(self._circuit.find_bit(qubit).index for qubit in instruction.qubits)
        gates = self._gates(operation) if len(qubits) == 1 and not instruction.clbits else None
        if gates is not None:
            self.found.gates += [gate.on(qubits[0]) for gate in gates]
        elif operation.name == "rzz" and is_standard(operation):
            self._interaction(position, instruction, qubits)
        elif operation.name != "global_phase" or not is_standard(operation):
            self._between(instruction, qubits)

    def _gates(self, operation: Any) -> Sequence[Gate] | None:
        """The gates of an operation on one qubit; None if it is not made of gates."""
        if operation.name in KNOWN_GATES and is_standard(operation):
            return standard(operation.name, [self._angle(value) for value in operation.params])
        definition = _definition(operation)
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
            return _angle(value, self._names, products=False)
        if found is None:
            try:
                found = _angle(value, self._names, products=False)
            except CircuitError:
                found = Angle.symbol(f"e{len(self.found.expressions)}")
                self.found.expressions.append(value)
            self._angles[value] = found
        return found

    def _interaction(self, position: int, instruction: Any, qubits: tuple[int, ...]) -> None:
        """An rzz, with its turns in the runs around it."""
        angle = self._angle(instruction.operation.params[0])
        turned = max(qubits, key=lambda qubit: self._pulsed[position, qubit])
        if angle.is_constant:
            rest, about_x, about_z = (float(v) for v in folded(np.array(angle.constant)))
            turns = Angle(about_x), Angle(about_z)
            instruction = with_angle(instruction, rest)
            number = None
        else:
            number = len(self.found.interactions)
            turns = Angle.symbol(f"x{number}"), Angle.symbol(f"z{number}")
            self.found.interactions.append(angle)
        across = [] if turns[0].equals(0.0) else [Gate("rx", turns[0], (turned,))]
        along = [] if turns[1].equals(0.0) else [Gate("rz", turns[1], (q,)) for q in qubits]
        self.found.gates += [*across, Gate("cz", None, qubits), *across, *along]
        self.found.between.append(Between(instruction, 1, number))

    def _between(self, instruction: Any, qubits: tuple[int, ...]) -> None:
        name, other = instruction.operation.name, self.found.width
        if name in COUPLINGS and is_standard(instruction.operation):
            couplings = [Gate(name, None, qubits)]
        else:
            stops = "cz" if name in _DIAGONAL and is_standard(instruction.operation) else "cx"
            of = qubits or range(other)  # without qubits: about bits or variables, in this order
            couplings = [Gate(stops, None, (other, qubit)) for qubit in of]
        self.found.gates += couplings
        self.found.between.append(Between(instruction, len(couplings)))


def is_standard(operation: Any) -> bool:
    """Whether the operation is Qiskit's own of that name, and not controlled by 0.

    Gates of users may have any name: a cz of theirs need not be diagonal.
    """
    module = getattr(operation, "base_class", type(operation)).__module__
    all_ones = (1 << getattr(operation, "num_ctrl_qubits", 0)) - 1
    return module.startswith(_MODULES) and getattr(operation, "ctrl_state", all_ones) == all_ones


def _pulsed_neighbours(circuit: Any) -> dict[tuple[int, int], int]:
    """For each rzz and qubit of it, how many of the runs beside it have a pulse anyway."""
    found: dict[tuple[int, int], int] = {}
    for order in (list(enumerate(circuit.data)), list(enumerate(circuit.data))[::-1]):
        pulsed = [False] * circuit.num_qubits
        for position, instruction in order:
            qubits = [circuit.find_bit(qubit).index for qubit in instruction.qubits]
            is_gate = len(qubits) == 1 and not instruction.clbits
            for qubit in qubits:
                if instruction.operation.name == "rzz":
                    key = position, qubit
                    found[key] = found.get(key, 0) + pulsed[qubit]
                if instruction.operation.name not in _VIRTUAL:
                    pulsed[qubit] = is_gate
    return found
