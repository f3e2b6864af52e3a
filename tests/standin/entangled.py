"""A few entangled qubits: Qiskit's state vector without noise, and the machine's readout."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from qiskit import QuantumCircuit
from qiskit.quantum_info import Statevector

from qcompile.device import Device

MOST_QUBITS = 12


def reduced(circuit: Any) -> tuple[QuantumCircuit, tuple[int, ...]]:
    """The gates of a circuit on the qubits it uses, and these qubits."""
    gates = [
        (instruction.operation, [circuit.find_bit(qubit).index for qubit in instruction.qubits])
        for instruction in circuit.data
        if instruction.operation.name not in ("measure", "barrier")
    ]
    qubits = sorted({qubit for _, on in gates for qubit in on})
    small = QuantumCircuit(len(qubits), global_phase=circuit.global_phase)
    for operation, on in gates:
        small.append(operation, [qubits.index(qubit) for qubit in on])
    return small, tuple(qubits)


def words_of(circuit: QuantumCircuit) -> str:
    """Its gates in order, the same for the same circuit."""
    return str(
        [
            (gate.name, [circuit.find_bit(qubit).index for qubit in gate.qubits], gate.params)
            for gate in circuit.data
        ]
    )


def outcomes(
    circuit: QuantumCircuit,
    qubits: tuple[int, ...],
    values: NDArray[np.float64],
    shots: int,
    device: Device,
    rng: np.random.Generator,
) -> dict[int, NDArray[np.bool_]]:
    """The bits (B, shots) of each qubit, for parameter values (B, P)."""
    bits = np.empty((len(values), shots, len(qubits)), dtype=np.bool_)
    for row, bound in zip(bits, map(circuit.assign_parameters, values), strict=True):
        chances = Statevector(bound).probabilities()
        drawn = rng.choice(len(chances), shots, p=chances / chances.sum())
        row[:] = drawn[:, np.newaxis] >> np.arange(len(qubits)) & 1
    errors = np.array([[device.qubits[qubit].p10, device.qubits[qubit].p01] for qubit in qubits])
    flips = rng.random(bits.shape) < np.where(bits, errors[:, 1], errors[:, 0])
    return {qubit: bits[:, :, index] ^ flips[:, :, index] for index, qubit in enumerate(qubits)}
