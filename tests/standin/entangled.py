"""Entangled qubits: Qiskit's state vector without noise, and the machine's readout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from qiskit import QuantumCircuit
from qiskit.quantum_info import Statevector

from qcompile.device import Device

MOST_QUBITS = 12
"""The most qubits that gates connect; there may be any number of such parts."""


@dataclass(frozen=True)
class Part:
    """Qubits that gates connect, their gates, and the columns of their parameters."""

    circuit: QuantumCircuit
    on: tuple[int, ...]
    columns: tuple[int, ...]


def parts(circuit: Any) -> tuple[Part, ...]:
    """The connected parts of a circuit, in the order of their first qubits."""
    gates = [
        (instruction.operation, [circuit.find_bit(qubit).index for qubit in instruction.qubits])
        for instruction in circuit.data
        if instruction.operation.name not in ("measure", "barrier")
    ]
    connected: list[set[int]] = []
    for _, on in gates:
        touched = [part for part in connected if not part.isdisjoint(on)]
        connected = [part for part in connected if part.isdisjoint(on)]
        connected.append({*on}.union(*touched))
    names = [parameter.name for parameter in circuit.parameters]
    return tuple(_part(gates, sorted(qubits), names) for qubits in sorted(connected, key=min))


def _part(gates: list[tuple[Any, list[int]]], qubits: list[int], names: list[str]) -> Part:
    small = QuantumCircuit(len(qubits))
    for operation, on in gates:
        if on[0] in qubits:
            small.append(operation, [qubits.index(qubit) for qubit in on])
    columns = tuple(names.index(parameter.name) for parameter in small.parameters)
    return Part(small, tuple(qubits), columns)


def words_of(circuit: QuantumCircuit) -> str:
    """Its gates in order, the same for the same circuit."""
    return str(
        [
            (gate.name, [circuit.find_bit(qubit).index for qubit in gate.qubits], gate.params)
            for gate in circuit.data
        ]
    )


def outcomes(
    part: Part,
    values: NDArray[np.float64],
    shots: int,
    device: Device,
    rng: np.random.Generator,
) -> dict[int, NDArray[np.bool_]]:
    """The bits (B, shots) of each qubit of a part, for values (B, P) of all parameters."""
    bits = np.empty((len(values), shots, len(part.on)), dtype=np.bool_)
    for row, numbers in zip(bits, values[:, [*part.columns]], strict=True):
        chances = Statevector(part.circuit.assign_parameters(numbers)).probabilities()
        drawn = rng.choice(len(chances), shots, p=chances / chances.sum())
        row[:] = drawn[:, np.newaxis] >> np.arange(len(part.on)) & 1
    errors = np.array([[device.qubits[qubit].p10, device.qubits[qubit].p01] for qubit in part.on])
    flips = rng.random(bits.shape) < np.where(bits, errors[:, 1], errors[:, 0])
    return {qubit: bits[:, :, index] ^ flips[:, :, index] for index, qubit in enumerate(part.on)}
