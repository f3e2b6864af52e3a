"""Circuits of several qubits in Qiskit: random ones, their operators, and what they measure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from qiskit import QuantumCircuit
from qiskit.circuit.library import XXMinusYYGate, XXPlusYYGate
from qiskit.quantum_info import Operator, Statevector

from qcompile.ir import Program

ON_ONE = {
    **dict.fromkeys("h x y z s sdg t tdg sx sxdg id".split(), 0),  # noqa: SIM905
    **dict.fromkeys(("rx", "ry", "rz", "p"), 1),
    "r": 2,
    "u": 3,
}
ON_SEVERAL = {
    **dict.fromkeys("cx cy cz ch cs csdg csx swap iswap dcx ecr".split(), (2, 0)),  # noqa: SIM905
    **dict.fromkeys("cp crx cry crz rxx ryy rzz rzx".split(), (2, 1)),  # noqa: SIM905
    **dict.fromkeys(("xx_plus_yy", "xx_minus_yy"), (2, 2)),
    "cu": (2, 4),
    **dict.fromkeys(("ccx", "ccz", "cswap", "rccx"), (3, 0)),
}
"""Methods of QuantumCircuit: how many angles they take, and how many qubits and angles."""
CLASSES = {"xx_plus_yy": XXPlusYYGate, "xx_minus_yy": XXMinusYYGate}


def random_qiskit(rng: np.random.Generator, qubits: int, most: int = 14) -> QuantumCircuit:
    """A random circuit of the standard gates."""
    circuit = QuantumCircuit(qubits)
    for _ in range(rng.integers(1, most)):
        if rng.random() < 0.45:
            name = str(rng.choice([*ON_ONE]))
            angles, on = rng.uniform(-4, 4, ON_ONE[name]), [int(rng.integers(qubits))]
        else:
            name = str(rng.choice([*ON_SEVERAL]))
            width, count = ON_SEVERAL[name]
            if width > qubits:
                continue
            angles, on = rng.uniform(-4, 4, count), rng.choice(qubits, width, False).tolist()
        if name in CLASSES:
            circuit.append(CLASSES[name](*angles), on)
        else:
            getattr(circuit, name)(*angles, *on)
    return circuit


def program_operator(program: Program, qubits: Sequence[int], count: int) -> np.ndarray:
    """The operator of a program without symbols, whose bit i is `qubits[i]` of so many qubits."""
    built = QuantumCircuit(count)
    for circuit, first in zip(program.circuits, program.first_bits, strict=True):
        for gate in circuit.gates:
            angles = () if gate.angle is None else (gate.angle.constant,)
            on = (qubits[first + qubit] for qubit in gate.qubits)
            getattr(built, gate.name)(*angles, *on)
    return Operator(built).data


def expectations(program: Program, values: Mapping[str, float]) -> np.ndarray:
    """<O> of every observable of a program, by Qiskit's statevector."""
    names = (*program.inputs, *program.parameters)
    bound = program.substitute({name: values[name] for name in names})
    matrix = program_operator(bound, range(bound.bits), bound.bits)
    probabilities = np.abs(matrix[:, 0]) ** 2
    return np.array([product(probabilities, observable) for observable in program.measured])


def difference(first: np.ndarray, second: np.ndarray) -> float:
    """The largest difference of two operators, up to global phase."""
    overlap = np.trace(first.conj().T @ second)
    return float(np.abs(first * (overlap / abs(overlap)) - second).max())


def measured(circuit: QuantumCircuit) -> tuple[list[int], np.ndarray]:
    """The bits that a circuit writes, and the distribution of their values, the first bit lowest.

    Barriers, delays and resets are left out, and so are qubits without gates.
    """
    qubit_of, gates = {}, []
    for item in circuit.data:
        qubits = [circuit.find_bit(qubit).index for qubit in item.qubits]
        if item.operation.name == "measure":
            qubit_of[circuit.find_bit(item.clbits[0]).index] = qubits[0]
        elif item.operation.name not in ("barrier", "delay", "reset"):
            gates.append((item.operation, qubits))
    used = sorted({q for _, qubits in gates for q in qubits} | {*qubit_of.values()})
    place = {qubit: index for index, qubit in enumerate(used)}
    small = QuantumCircuit(len(used))
    for operation, qubits in gates:
        small.append(operation, [place[qubit] for qubit in qubits])
    bits = sorted(qubit_of)
    return bits, Statevector(small).probabilities([place[qubit_of[bit]] for bit in bits])


def product(probabilities: np.ndarray, bits: Sequence[int]) -> float:
    """The expectation of a product of Z of some bits of a distribution."""
    numbers = np.arange(probabilities.size)
    odd = sum(numbers >> bit & 1 for bit in bits) % 2
    return float((probabilities * (1 - 2 * odd)).sum())
