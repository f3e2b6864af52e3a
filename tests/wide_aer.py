"""Executables of one circuit of several qubits in Aer's density matrix, with a backend's noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from qiskit import QuantumCircuit
from qiskit_aer import AerSimulator
from qiskit_aer.noise import NoiseModel

from qcompile.passes import Executable
from qcompile.snapshot import find_backend


def noisy_simulator(name: str) -> Any:
    """The density matrices of a fake backend, with Qiskit's own noise model of it."""
    noise = NoiseModel.from_backend_properties(find_backend(name).properties())
    return AerSimulator(method="density_matrix", noise_model=noise)


def by_aer(executable: Executable, x: np.ndarray, theta: np.ndarray, simulator: Any) -> np.ndarray:
    """<O> of all observables for one row, gate by gate, with the readout of the device."""
    (native,), width = executable.native.circuits, executable.source.bits
    angles = iter(executable.bind(x[None], theta)[0].tolist())
    placed = executable.qubits.tolist()
    built = QuantumCircuit(len(executable.device.qubits))
    for gate in native.gates:
        angle = () if gate.angle is None else (next(angles),)
        getattr(built, gate.name)(*angle, *(placed[qubit] for qubit in gate.qubits))
    built.save_probabilities(placed[:width][::-1])
    p = simulator.run(built).result().data()["probabilities"].reshape((2,) * width)
    for axis in range(width):
        qubit = executable.device.qubits[placed[axis]]
        errors = [[1 - qubit.p10, qubit.p01], [qubit.p10, 1 - qubit.p01]]
        p = np.moveaxis(np.tensordot(errors, p, (1, axis)), 0, axis)
    outcomes = np.indices((2,) * width)
    observables = executable.source.measured
    return np.array([(p * (-1) ** outcomes[list(o)].sum(axis=0)).sum() for o in observables])
