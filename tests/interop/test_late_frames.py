"""The signs of rzz: right for every value, and at no cost along a tree of couplings."""

from __future__ import annotations

import math

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.circuit import ParameterVector
from qiskit.quantum_info import Statevector
from qiskit.transpiler import generate_preset_pass_manager
from qiskit_ibm_runtime.fake_provider import FakeFractionalBackend

import qcompile


def diagonal_circuit(rng: np.random.Generator, qubits: int) -> QuantumCircuit:
    """Many rzz with rotations about z between them, few pulses and few other couplings."""
    angles = ParameterVector("v", 6)
    circuit = QuantumCircuit(qubits)
    circuit.h(range(qubits))
    for _ in range(8 * qubits):
        first, second = rng.choice(qubits, 2, replace=False).tolist()
        angle = [
            angles[rng.integers(6)],
            3 * angles[rng.integers(6)] - angles[rng.integers(6)],
            angles[rng.integers(6)] * angles[rng.integers(6)],
            float(rng.uniform(-9, 9)),
        ][rng.integers(4)]
        kind = rng.random()
        if kind < 0.6:
            circuit.rzz(angle, first, second)
        elif kind < 0.75:
            getattr(circuit, str(rng.choice(["rz", "p"])))(angle, first)
        elif kind < 0.85:
            circuit.rx(angle, first)
        elif kind < 0.95:
            getattr(circuit, str(rng.choice(["cz", "cx", "ecr"])))(first, second)
        else:
            circuit.barrier(first)
    return circuit


@pytest.mark.parametrize("seed", range(30))
def test_the_state_is_kept_and_every_angle_is_in_range(seed: int) -> None:
    rng = np.random.default_rng(seed)
    circuit = diagonal_circuit(rng, 2 + seed % 4)
    bound = qcompile.qiskit.late(circuit)
    values = rng.uniform(-5, 5, (3, circuit.num_parameters))
    for row, angles in zip(values, bound.angles(values), strict=True):
        template = bound.circuit.assign_parameters(angles)
        expected = Statevector(circuit.assign_parameters(row))
        assert abs(abs(expected.inner(Statevector(template))) - 1) < 1e-10
        assert all(0 <= i.params[0] <= math.pi / 2 for i in template.get_instructions("rzz"))


@pytest.mark.parametrize(
    ("edges", "extra"),
    [
        ([(0, 1), (1, 2), (2, 3)], 0),
        ([(0, 1), (0, 2), (0, 3)], 0),
        ([(0, 1), (1, 2), (2, 3), (3, 0)], 2),
    ],
    ids=["line", "star", "ring"],
)
def test_pulses_of_qaoa(edges: list[tuple[int, int]], extra: int) -> None:
    """Two more for an edge that closes a cycle, at most, in each of three layers."""
    backend = FakeFractionalBackend()
    beta, gamma = ParameterVector("b", 3), ParameterVector("g", 3)
    circuit = QuantumCircuit(4)
    circuit.h(range(4))
    for layer in range(3):
        for edge in edges:
            circuit.rzz(2 * gamma[layer], *edge)
        circuit.rx(2 * beta[layer], range(4))
    isa = generate_preset_pass_manager(3, backend, seed_transpiler=0).run(circuit)
    before, after = isa.count_ops(), qcompile.qiskit.late(isa, backend).circuit.count_ops()
    assert after["rzz"] == before["rzz"]
    assert after["rx"] <= before["rx"] + 3 * extra
