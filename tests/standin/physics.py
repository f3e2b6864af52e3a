"""The measurements of the stand-in's machines: bits drawn from the noise of a calibration.

A circuit without entangling gates is a product of qubits. Each qubit is a Bloch vector that the
affine maps of `qcompile.noise` move, for all parameter values at once; its bits are independent
from shot to shot. Where a circuit entangles, each of its connected parts may have a few qubits; all
are free of noise until they are read.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import lambdify

from qcompile.device import Device
from qcompile.noise import noise_after, readout_row, rotation_map

from .entangled import MOST_QUBITS, Part, outcomes, parts, words_of

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Angle = Callable[[FloatArray], Any]
"""An angle of parameter values (P, B): a number or (B,)."""

PLAYED = ("rz", "rx", "sx", "x", "id", "reset", "measure", "barrier")
"""Instructions of a product of qubits, of which there may be any number."""
_PULSES = {"sx": math.pi / 2, "x": math.pi}


class RefusedError(ValueError):
    """A circuit that the machine, or the stand-in, cannot run."""


@dataclass(frozen=True)
class Step:
    """One gate on one qubit, with its angle where it has one."""

    gate: str
    qubit: int
    angle: Angle | None = None


@dataclass(frozen=True)
class Plan:
    """A circuit ready to run: its gates in order, and the qubit that each bit reads.

    `registers` holds the qubits of each classical register, None where a bit is never written. One
    that entangles has no steps, but its connected parts `entangled`.
    """

    qubits: int
    parameters: int
    steps: tuple[Step, ...]
    registers: dict[str, tuple[int | None, ...]]
    entangled: tuple[Part, ...] = ()


@dataclass(frozen=True)
class Item:
    """A plan, the values of its parameters (..., P), and the shots of each of its circuits."""

    plan: Plan
    values: FloatArray
    shots: int

    @property
    def shape(self) -> tuple[int, ...]:
        return self.values.shape[:-1]

    @property
    def circuits(self) -> int:
        return math.prod(self.shape)

    @property
    def executions(self) -> int:
        return self.circuits * self.shots


def plan(circuit: Any, basis_gates: Sequence[str], width: int) -> Plan:
    """The plan of a QuantumCircuit for a machine with these gates and `width` qubits.

    Raises:
        RefusedError: the machine lacks a gate or a qubit, or the circuit entangles many qubits,
            branches, or has gates after a measurement.
    """
    if circuit.num_qubits > width:
        raise RefusedError(f"The circuit has {circuit.num_qubits} qubits, the machine {width}.")
    parameters = list(circuit.parameters)
    steps: list[Step] = []
    written: dict[Any, int] = {}
    entangles = any(instruction.operation.name not in PLAYED for instruction in circuit.data)
    for instruction in circuit.data:
        name = instruction.operation.name
        if name not in (*basis_gates, "measure", "barrier", "reset"):
            raise RefusedError(f"The instruction {name} is not supported by the machine.")
        qubits = [circuit.find_bit(qubit).index for qubit in instruction.qubits]
        if name == "barrier":
            continue
        if used := set(qubits) & set(written.values()):
            raise RefusedError(f"Qubit {min(used)} is used after its measurement.")
        if name == "measure":
            written[instruction.clbits[0]] = qubits[0]
            continue
        if entangles:
            _check_entangled(name)
            continue
        angles = [_angle(value, parameters) for value in instruction.operation.params]
        steps.append(Step(name, qubits[0], *angles))
    registers = {reg.name: tuple(written.get(bit) for bit in reg) for reg in circuit.cregs}
    entangled = parts(circuit) if entangles else ()
    most = max((len(part.on) for part in entangled), default=0)
    if most > MOST_QUBITS:
        raise RefusedError(f"The stand-in entangles {MOST_QUBITS} qubits at most, not {most}.")
    return Plan(circuit.num_qubits, circuit.num_parameters, tuple(steps), registers, entangled)


def _check_entangled(name: str) -> None:
    if name in ("reset", "if_else", "while_loop", "for_loop", "switch_case"):
        raise RefusedError(f"The stand-in does not play {name} where qubits are entangled.")


def _angle(value: Any, parameters: Sequence[Any]) -> Angle:
    """The angle that a number, a parameter or an expression of parameters stands for."""
    if not getattr(value, "parameters", None):
        constant = float(value)
        return lambda values: constant
    if value in parameters:
        column = parameters.index(value)
        return lambda values: values[column]
    used = sorted(value.parameters, key=parameters.index)
    columns = [parameters.index(parameter) for parameter in used]
    formula = lambdify([p.sympify() for p in used], value.sympify(), "numpy")
    return lambda values: formula(*values[columns])


def draw(items: Sequence[Item], device: Device, seed: int) -> list[dict[str, BoolArray]]:
    """The bits of each item by register, each (..., shots, bits) with bit 0 first.

    The same items, device and seed give the same bits: the generator is seeded with a digest of
    the gates, the angles and the shots, and with nothing of the job around them.
    """
    columns = [
        np.moveaxis(item.values.reshape(item.circuits, item.plan.parameters), -1, 0)
        for item in items
    ]
    angles = [
        [None if step.angle is None else np.asarray(step.angle(values)) for step in item.plan.steps]
        for item, values in zip(items, columns, strict=True)
    ]
    digest = hashlib.sha256(f"{seed} {device.name}".encode())
    for item, turned in zip(items, angles, strict=True):
        gates: list[Any] = [(step.gate, step.qubit) for step in item.plan.steps]
        if item.plan.entangled:
            words = [(words_of(part.circuit), part.on) for part in item.plan.entangled]
            gates = [words, item.values.tobytes()]
        what = (item.plan.qubits, item.shape, item.shots, gates, item.plan.registers)
        digest.update(repr(what).encode())
        for angle in turned:
            digest.update(b"-" if angle is None else angle.tobytes())
    rng = np.random.default_rng(int.from_bytes(digest.digest()))
    return [
        _registers(item, _drawn(item, turned, device, rng))
        for item, turned in zip(items, angles, strict=True)
    ]


def p_one(item: Item, angles: Sequence[Any], device: Device) -> dict[int, FloatArray]:
    """P(1) of every measured qubit, each of shape (circuits,)."""
    ground = np.array([1.0, 0.0, 0.0, 1.0])[:, np.newaxis]
    vectors: dict[int, FloatArray] = {}
    for step, angle in zip(item.plan.steps, angles, strict=True):
        vector = _after(step, angle, vectors.get(step.qubit, ground))
        vectors[step.qubit] = noise_after(step.gate, device.qubits[step.qubit]) @ vector
    measured = {q for qubits in item.plan.registers.values() for q in qubits if q is not None}
    result = {}
    for qubit in measured:
        z = readout_row(device.qubits[qubit]) @ vectors.get(qubit, ground)
        result[qubit] = np.broadcast_to(np.clip((1 - z) / 2, 0, 1), item.circuits)
    return result


def _after(step: Step, angle: Any, vector: FloatArray) -> FloatArray:
    """The vector, (4, B) or (4, 1), after a perfect gate."""
    if step.gate in _PULSES:
        return np.asarray(rotation_map("x", _PULSES[step.gate]) @ vector)
    if step.gate == "reset":
        return np.array([1.0, 0.0, 0.0, 1.0])[:, np.newaxis]
    if step.gate == "id":
        return vector
    one, x, y, z = vector
    cos, sin = np.cos(angle), np.sin(angle)
    if step.gate == "rz":
        x, y = x * cos - y * sin, x * sin + y * cos
    else:
        y, z = y * cos - z * sin, y * sin + z * cos
    return np.stack(np.broadcast_arrays(one, x, y, z))


def _drawn(
    item: Item, angles: Sequence[Any], device: Device, rng: np.random.Generator
) -> dict[int, BoolArray]:
    """The bits of the measured qubits, (circuits, shots) each."""
    if item.plan.entangled:
        values = item.values.reshape(item.circuits, item.plan.parameters)
        drawn = [outcomes(part, values, item.shots, device, rng) for part in item.plan.entangled]
        return {qubit: bits for part in drawn for qubit, bits in part.items()}
    chances = p_one(item, angles, device)
    return {
        qubit: rng.random((item.circuits, item.shots)) < chances[qubit][:, np.newaxis]
        for qubit in sorted(chances)
    }


def _registers(item: Item, drawn: dict[int, BoolArray]) -> dict[str, BoolArray]:
    result = {}
    for name, qubits in item.plan.registers.items():
        bits = np.zeros((item.circuits, item.shots, len(qubits)), dtype=np.bool_)
        for index, qubit in enumerate(qubits):
            if qubit is not None:
                bits[:, :, index] = drawn.get(qubit, False)
        result[name] = bits.reshape(*item.shape, item.shots, len(qubits))
    return result
