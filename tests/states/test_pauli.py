"""Noisy circuits of several qubits against Aer's density matrices, with its noise and readout."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest

from qcompile.device import IDEAL, Coupling, Device, load_device
from qcompile.ir import COUPLINGS, Angle, Circuit, Gate
from qcompile.states.ideal import IdealBlocks
from qcompile.states.pauli import NoisyBlocks

WIDTH = 5


@cache
def machine(name: str, gate: str) -> tuple[Device, Any]:
    """A snapshot with its couplings, called `gate`, and Aer's noise model of them."""
    from qiskit_aer.noise import NoiseModel
    from qiskit_aer.noise.device.models import basic_device_gate_errors

    from qcompile.snapshot import find_backend

    properties = find_backend(name).properties()
    couplings = []
    for each in properties.gates:
        if len(each.qubits) == 2:
            values = {value.name: value.value for value in each.parameters}
            each.gate = gate
            couplings.append(
                Coupling(
                    gate=gate,
                    qubits=tuple(each.qubits),
                    error=values["gate_error"],
                    length_ns=values["gate_length"],
                )
            )
    noise = NoiseModel()
    for word, qubits, error in basic_device_gate_errors(properties):
        noise.add_quantum_error(error, word, qubits)
    values = load_device(name).model_dump()
    values |= {"format": "qcompile-device-2", "couplings": couplings}
    return Device.model_validate(values), noise


def random_circuit(
    rng: np.random.Generator, width: int, pairs: list[tuple[int, int]], gate: str
) -> Circuit:
    gates = []
    for _ in range(rng.integers(8, 40)):
        if rng.random() < 0.35:
            gates.append(Gate(gate, None, pairs[rng.integers(len(pairs))]))
        else:
            name = str(rng.choice(["rz", "sx", "x"]))
            angle = Angle.of(float(rng.uniform(-3, 3))) if name == "rz" else None
            gates.append(Gate(name, angle, (int(rng.integers(width)),)))
    return Circuit(tuple(gates), width)


def expected(circuit: Circuit, placed: list[int], device: Device, noise: Any) -> np.ndarray:
    """<Z_S> of every subset of the circuit's qubits, the first one's bit highest."""
    from qiskit import QuantumCircuit
    from qiskit_aer import AerSimulator

    built = QuantumCircuit(max(placed) + 1)
    for gate in circuit.gates:
        angle = () if gate.angle is None else (gate.angle.constant,)
        getattr(built, gate.name)(*angle, *(placed[qubit] for qubit in gate.qubits))
    built.save_probabilities(placed[::-1])  # the first of them is the lowest bit
    simulator = AerSimulator(method="density_matrix", noise_model=noise)
    found = simulator.run(built, seed_simulator=0).result().data()["probabilities"]
    found = found.reshape((2,) * circuit.width)
    for axis, qubit in enumerate(placed):
        if not device.is_ideal:
            errors = device.qubits[qubit]
            matrix = [[1 - errors.p10, errors.p01], [errors.p10, 1 - errors.p01]]
            found = np.moveaxis(np.tensordot(matrix, found, (1, axis)), 0, axis)
    signs = np.array([[1, 1], [1, -1]])
    for axis in range(circuit.width):
        found = np.moveaxis(np.tensordot(signs, found, (1, axis)), 0, axis)
    return found.ravel()


def parities(circuits: list[Circuit], device: Device, qubits: list[list[int]]) -> np.ndarray:
    blocks = (
        IdealBlocks(circuits)
        if device.is_ideal
        else NoisyBlocks(circuits, device, np.array(qubits))
    )
    angles = np.array([[[angle.constant for angle in c.angles] for c in circuits]])
    return blocks.parities(np.cos(angles), np.sin(angles))[0]


@pytest.mark.parametrize("gate", COUPLINGS)
@pytest.mark.parametrize("name", ["fake_lima", "fake_jakarta"])
@pytest.mark.parametrize("width", [2, 3, 4, 5])
def test_all_products_of_z_with_the_noise_of_a_device(name: str, gate: str, width: int) -> None:
    device, noise = machine(name, gate)
    rng = np.random.default_rng(width)
    placed = {2: [3, 1], 3: [0, 1, 2], 4: [3, 1, 0, 2], 5: [0, 1, 2, 3, 4]}[width]
    pairs = [
        (placed.index(a), placed.index(b))
        for _, a, b in device.coupling_calibrations
        if {a, b} <= set(placed)
    ]
    for _ in range(4):
        circuit = random_circuit(rng, width, pairs, gate)
        found = parities([circuit], device, [placed])[0]
        np.testing.assert_allclose(found, expected(circuit, placed, device, noise), atol=1e-12)


@pytest.mark.parametrize("width", [1, 2, 6])
def test_all_products_of_z_without_noise(width: int) -> None:
    rng = np.random.default_rng(width)
    pairs = [pair for pair in product(range(width), repeat=2) if len(set(pair)) == 2] or [(0, 0)]
    for gate in COUPLINGS if width > 1 else ("x",):
        circuit = (
            random_circuit(rng, width, pairs, gate) if width > 1 else Circuit.parse("sx rz(1) sx")
        )
        found = parities([circuit], IDEAL, [list(range(width))])[0]
        wanted = expected(circuit, list(range(width)), IDEAL, None)
        np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_a_batch_is_its_rows_and_circuits() -> None:
    device, _ = machine("fake_lima", "cx")
    circuit = Circuit.parse("sx@0 rz(0.1)@0 sx@0 cx@0,1 rz(0.2)@1 sx@1 cx@1,2 sx@2 rz(0.3)@2", 3)
    circuits, qubits = [circuit, circuit], [[0, 1, 2], [2, 1, 3]]
    rng = np.random.default_rng(0)
    angles = rng.uniform(-3, 3, (40, 2, 3))
    together = NoisyBlocks(circuits, device, np.array(qubits)).parities(
        np.cos(angles), np.sin(angles)
    )
    assert together.shape == (40, 2, 8)
    for row, which in product((0, 17, 39), (0, 1)):
        bound = circuit.with_angles(map(Angle.of, angles[row, which].tolist()))
        alone = parities([bound], device, [qubits[which]])[0]
        np.testing.assert_allclose(together[row, which], alone, atol=1e-13)
    single = NoisyBlocks(circuits, device, np.array(qubits), np.float32)
    found = single.parities(np.cos(angles), np.sin(angles))
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, together, atol=2e-6)
