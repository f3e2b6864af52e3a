"""Noisy circuits of many qubits, as density matrices of Qiskit's Aer.

Beyond 8 qubits Aer is as fast as our Pauli vectors, or faster. The noise is the same: the channels
of `qcompile.noise` after each gate, and the readout errors of each qubit.

Source: qiskit_aer, AerSimulator and NoiseModel; qiskit.quantum_info, PTM.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.device import Device, Qubit
from qcompile.errors import MissingExtraError
from qcompile.ir import Circuit
from qcompile.noise.channels import channel_after_coupling
from qcompile.noise.circuits import channel_map, noise_after, readout_row


class DensityBlocks:
    """Native circuits on physical `qubits` (circuits, width) of a device, one row at a time.

    Raises:
        MissingExtraError: Qiskit or Aer is not installed.
    """

    def __init__(self, circuits: Sequence[Circuit], device: Device, qubits: IntArray):
        try:
            from qiskit_aer import AerSimulator
        except ImportError as error:
            what = f"The noise of a circuit of {circuits[0].width} qubits"
            raise MissingExtraError(what, "qiskit") from error
        self._name = f"{len(circuits)} circuits on {circuits[0].width} qubits of {device.name}"
        self._runs, self._readout = [], []
        for circuit, row in zip(circuits, qubits.tolist(), strict=True):
            simulator = AerSimulator(
                method="density_matrix",
                noise_model=_noise_model(circuit, device, row),
                max_parallel_experiments=1,  # a density matrix may fill the memory
            )
            self._runs.append((simulator, *_parametrised(circuit)))
            self._readout.append([_outcome_map(device.qubits[qubit]) for qubit in row])

    def __repr__(self) -> str:
        return f"DensityBlocks({self._name})"

    def parities(self, cos: FloatArray, sin: FloatArray) -> FloatArray:
        """The measured expectations of all products of Z, as `NoisyBlocks.parities`."""
        rows, circuits = cos.shape[:2]
        angles = np.arctan2(sin, cos)
        width = len(self._readout[0])
        result = np.empty((rows, circuits, *(2,) * width))
        for place, (simulator, circuit, parameters) in enumerate(self._runs):
            values = angles[:, place, : len(parameters)].T.tolist()
            binds = [dict(zip(parameters, values, strict=True))] if parameters else None
            found = simulator.run([circuit], parameter_binds=binds).result()
            experiments = rows if parameters else 1
            p = np.array([found.data(i)["probabilities"] for i in range(experiments)])
            result[:, place] = p.reshape(experiments, *(2,) * width)
        return _measured(result, np.array(self._readout)).reshape(rows, circuits, -1)


def _outcome_map(qubit: Qubit) -> FloatArray:
    """The map from P(0) and P(1) of a qubit to 1 and the measured `<Z>`, (2, 2)."""
    offset, _, _, contrast = readout_row(qubit)
    return np.array([[1.0, 1.0], [offset + contrast, offset - contrast]])


def _measured(p: FloatArray, maps: FloatArray) -> FloatArray:
    """The parities, (B, circuits, 2, ...), of probabilities of that shape; maps are by circuit."""
    for axis in range(maps.shape[1]):
        moved = np.moveaxis(p, axis + 2, -1)
        by_circuit = moved.reshape(*moved.shape[:2], -1, 2) @ maps[:, axis].swapaxes(1, 2)
        p = np.moveaxis(by_circuit.reshape(moved.shape), -1, axis + 2)
    return p


def _parametrised(circuit: Circuit) -> tuple[Any, list[Any]]:
    """The circuit for Aer, and its parameters in the order of slots."""
    from qiskit import QuantumCircuit
    from qiskit.circuit import Parameter

    built = QuantumCircuit(circuit.width)
    parameters: list[Any] = []
    for gate in circuit.gates:
        if gate.angle is not None:
            parameters.append(Parameter(f"a{len(parameters)}"))
        words = () if gate.angle is None else (parameters[-1],)
        getattr(built, gate.name)(*words, *gate.qubits)
    built.save_probabilities(list(range(circuit.width))[::-1])  # the first qubit's bit is highest
    return built, parameters


def _noise_model(circuit: Circuit, device: Device, placed: Sequence[int]) -> Any:
    """Aer's noise model of the gates of a circuit, on its own qubits."""
    from qiskit.quantum_info import PTM, Kraus
    from qiskit_aer.noise import NoiseModel, QuantumError

    noise = NoiseModel(basis_gates=sorted({gate.name for gate in circuit.gates}))
    for name, qubits, transfer in _transfers(circuit, device, placed):
        if not np.array_equal(transfer, np.eye(len(transfer))):
            noise.add_quantum_error(QuantumError(Kraus(PTM(transfer))), name, list(qubits))
    return noise


def _transfers(
    circuit: Circuit, device: Device, placed: Sequence[int]
) -> Iterator[tuple[str, tuple[int, ...], FloatArray]]:
    """The Pauli transfer matrix of the noise after each gate, on the circuit's own qubits."""
    for name, qubits in dict.fromkeys((gate.name, gate.qubits) for gate in circuit.gates):
        on = [device.qubits[placed[qubit]] for qubit in qubits]
        if len(on) == 1:
            yield name, qubits, noise_after(name, on[0])
            continue
        first, second = (placed[qubit] for qubit in qubits)
        calibration = device.coupling_calibrations.get((name, first, second))
        left, relaxed = channel_after_coupling(calibration, on)
        depolarised = np.diag([1.0, *[left] * 15])
        # Qiskit's first qubit is the last factor.
        both = np.kron(channel_map(relaxed[1]), channel_map(relaxed[0]))
        yield name, qubits, np.asarray(both @ depolarised)
