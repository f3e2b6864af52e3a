"""Circuits with entangling gates beside the peers, in one run: `python benchmarks/entangled.py`."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from measure import Row, compared, in_turn, show

import qcompile
from qcompile.ir import Circuit
from qcompile.nn import CircuitLayer
from qcompile.passes import Executable
from qcompile.snapshot import find_backend

LAYERS, BINDINGS = 5, 256


def reuploading(qubits: int) -> qcompile.Program:
    """The circuit of Skolik et al.: trained ry rz, a ring of cz, inputs again in every layer."""
    gates: list[list[object]] = []
    for layer in range(LAYERS):
        for qubit in range(qubits):
            number = 2 * (layer * qubits + qubit)
            gates += [["rx", f"x{qubit}", qubit], ["ry", f"theta{number}", qubit]]
            gates += [["rz", f"theta{number + 1}", qubit]]
        ring = range(qubits) if qubits > 2 else range(1)
        gates += [["cz", qubit, (qubit + 1) % qubits] for qubit in ring]
    parameters = 2 * LAYERS * qubits
    return qcompile.Program.of([Circuit.of(gates, qubits)], qubits, parameters)


def noisy(qubits: int, device_name: str, wanted: str) -> list[Row]:
    """All <Z> with a device's noise, one set of angles after another in a single call of each."""
    device = qcompile.load_device(device_name)
    program = reuploading(qubits)
    executable = qcompile.compile(program, device)
    executor = qcompile.OfflineExecutor(device)
    rng = np.random.default_rng(0)
    x = rng.uniform(-2, 2, (BINDINGS, qubits))
    theta = rng.uniform(-3, 3, len(program.parameters))
    ours = lambda: executor.expectation(executable, x, theta)  # noqa: E731
    couplings = executable.gate_counts()[0]["cx"]
    what = f"<Z> of {BINDINGS} x {qubits} qubits, {LAYERS} layers, {couplings} cx, noise of "
    aer = by_aer(executable, executable.bind(x, theta), device_name)
    found, expected = ours(), aer()
    assert np.abs(found - expected).max() < 1e-9
    rows = [compared(f"{what}{device_name}; Aer: parameter_binds", in_turn(ours, aer, 5), wanted)]
    if qubits <= 4:
        few = 8
        mixed = by_pennylane(executable, executable.bind(x[:few], theta))
        pairs = in_turn(ours, mixed, 3)
        rows.append(
            compared(
                f"{what}{device_name}; PennyLane: default.mixed, its own noise, per binding",
                pairs,
                ">= 100",
                work=BINDINGS / few,
            )
        )
    return rows


def by_aer(executable: Executable, angles: np.ndarray, name: str) -> Callable[[], np.ndarray]:
    """<Z> of all qubits from density matrices of one call, readout included."""
    from qiskit import QuantumCircuit
    from qiskit.circuit import Parameter
    from qiskit_aer import AerSimulator
    from qiskit_aer.noise import NoiseModel

    placed = executable.qubits.tolist()
    circuit = QuantumCircuit(len(executable.device.qubits))
    binds: dict[Any, list[float]] = {}
    for gate in executable.native.circuits[0].gates:
        words: tuple[Any, ...] = ()
        if gate.angle is not None:
            words = (Parameter(f"a{len(binds):04}"),)
            binds[words[0]] = angles[:, len(binds)].tolist()
        getattr(circuit, gate.name)(*words, *(placed[qubit] for qubit in gate.qubits))
    measured = [placed[bit] for (bit,) in executable.native.measured]
    circuit.save_probabilities(measured)
    noise = NoiseModel.from_backend_properties(find_backend(name).properties())
    simulator = AerSimulator(method="density_matrix", noise_model=noise)
    signs = 1 - 2 * (np.arange(2 ** len(measured))[:, None] >> np.arange(len(measured)) & 1)
    errors = [executable.device.qubits[qubit] for qubit in measured]
    contrast = np.array([qubit.contrast for qubit in errors])
    offset = np.array([qubit.p01 - qubit.p10 for qubit in errors])

    def run() -> np.ndarray:
        result = simulator.run(circuit, parameter_binds=[binds]).result()
        p = np.array([result.data(i)["probabilities"] for i in range(len(angles))])
        return offset + contrast * (p @ signs)

    return run


def by_pennylane(executable: Executable, angles: np.ndarray) -> Callable[[], object]:
    """The same gates on default.mixed, each followed by channels; one set of angles a call."""
    import pennylane as qml

    (native,) = executable.native.circuits
    device = qml.device("default.mixed", wires=native.width)

    @qml.qnode(device)
    def circuit(values: np.ndarray) -> Any:
        numbers = iter(values)
        for gate in native.gates:
            if gate.name == "rz":
                qml.RZ(next(numbers), gate.qubits[0])
                continue
            named = {"sx": qml.SX, "x": qml.PauliX, "cx": qml.CNOT}[gate.name]
            named(wires=gate.qubits)
            for qubit in gate.qubits:
                qml.DepolarizingChannel(0.001, wires=qubit)
                qml.AmplitudeDamping(0.001, wires=qubit)
                qml.PhaseDamping(0.001, wires=qubit)
        return [qml.expval(qml.PauliZ(bit)) for (bit,) in executable.native.measured]

    return lambda: [circuit(row) for row in angles]


def gradients(rows: int, wanted: str) -> Row:
    """Forward and backward through 4 qubits, 5 layers, in double precision."""
    import pennylane as qml

    program = reuploading(4)
    layer = CircuitLayer(program).double()
    theta = layer.theta.detach().clone().requires_grad_()
    x = torch.rand(rows, 4, dtype=torch.float64)
    device = qml.device("default.qubit", wires=4)

    @qml.qnode(device, interface="torch", diff_method="backprop")
    def circuit(inputs: torch.Tensor, weights: torch.Tensor) -> Any:
        numbers = iter(weights)
        for gate in program.circuits[0].gates:
            if gate.is_coupling:
                qml.CZ(wires=gate.qubits)
            elif gate.name == "rx":
                qml.RX(inputs[:, gate.qubits[0]], gate.qubits[0])
            else:
                named = {"ry": qml.RY, "rz": qml.RZ}[gate.name]
                named(next(numbers), gate.qubits[0])
        return [qml.expval(qml.PauliZ(qubit)) for qubit in range(4)]

    def ours() -> None:
        layer.theta.grad = None
        layer(x).sum().backward()

    def theirs() -> None:
        theta.grad = None
        torch.stack(circuit(x, theta)).sum().backward()

    ours()
    theirs()
    torch.testing.assert_close(layer.theta.grad, theta.grad)
    what = f"gradient of {rows} x 4 qubits, {LAYERS} layers, float64; PennyLane: backprop, one call"
    return compared(what, in_turn(ours, theirs, 15), wanted)


def rows() -> list[Row]:
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    return [
        *noisy(4, "fake_lima", ">= 12"),
        *noisy(6, "fake_jakarta", ">= 8"),
        gradients(16, ">= 15"),
        gradients(512, ">= 6"),
    ]


if __name__ == "__main__":
    show(rows, "Circuits with entangling gates beside the peers.")
