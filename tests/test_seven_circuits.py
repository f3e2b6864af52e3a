"""Seven circuits of the literature, on every kind of coupling: the same states as Qiskit's.

Skolik (arXiv 2103.15084), Jerbi (2103.05577), Chen (1907.00397), Lan (2112.11921), EfficientSU2,
RealAmplitudes, and QAOA on a ring.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np
import pytest
from qiskit import QuantumCircuit, transpile
from qiskit.circuit.library import efficient_su2, real_amplitudes
from qiskit.quantum_info import Operator, SparsePauliOp, Statevector

import qcompile
from qcompile.device import Device, load_device
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable

Gates = list[list[object]]


def skolik() -> Gates:
    gates: Gates = []
    theta = names("theta", 40)
    for _ in range(5):
        for q in range(4):
            gates += [["rx", f"x{q}", q], ["ry", next(theta), q], ["rz", next(theta), q]]
        gates += [["cz", q, (q + 1) % 4] for q in range(4)]
    return gates


def jerbi() -> Gates:
    theta = names("theta", 16)
    gates: Gates = [["h", q] for q in range(4)]
    for layer in range(2):
        for q in range(4):
            gates += [["rz", next(theta), q], ["ry", next(theta), q]]
        if not layer:
            gates += [["cz", *pair] for pair in combinations(range(4), 2)]
            gates += [g for q in range(4) for g in (["ry", f"x{q}", q], ["rz", f"x{q}", q])]
    return gates


def chen() -> Gates:
    theta = names("theta", 24)
    gates: Gates = [g for q in range(4) for g in (["rx", f"x{q}", q], ["rz", f"x{q}", q])]
    for _ in range(2):
        gates += [["cx", q, q + 1] for q in range(3)]
        for q in range(4):
            gates += [["rz", next(theta), q], ["ry", next(theta), q], ["rz", next(theta), q]]
    return gates


def lan() -> Gates:
    theta = names("theta", 27)
    gates: Gates = []
    for layer in range(3):
        for q in range(3):
            gates += [["rz", next(theta), q], ["ry", next(theta), q], ["rz", next(theta), q]]
        gates += [["cx", q, (q + 1) % 3] for q in range(3)]
        gates += [["rx", f"x{q}", q] for q in range(3)] if layer < 2 else []
    return gates


def su2() -> Gates:
    theta = names("theta", 24)
    gates: Gates = []
    for layer in range(3):
        for rotation in ("ry", "rz"):
            gates += [[rotation, next(theta), q] for q in range(4)]
        gates += [["cx", q, q + 1] for q in (2, 1, 0)] if layer < 2 else []
    return gates


def amplitudes() -> Gates:
    theta = names("theta", 16)
    gates: Gates = []
    for layer in range(4):
        gates += [["ry", next(theta), q] for q in range(4)]
        gates += [["cx", q, q + 1] for q in (2, 1, 0)] if layer < 3 else []
    return gates


def qaoa() -> Gates:
    gates: Gates = [["h", q] for q in range(4)]
    for layer in range(2):
        for q in range(4):
            pair = q, (q + 1) % 4
            gates += [["cx", *pair], ["rz", f"2*theta{2 * layer}", pair[1]], ["cx", *pair]]
        gates += [["rx", f"2*theta{2 * layer + 1}", q] for q in range(4)]
    return gates


CIRCUITS: dict[str, tuple[Callable[[], Gates], int, int, int]] = {
    "skolik": (skolik, 4, 4, 40),
    "jerbi": (jerbi, 4, 4, 16),
    "chen": (chen, 4, 4, 24),
    "lan": (lan, 3, 3, 27),
    "efficient_su2": (su2, 4, 0, 24),
    "real_amplitudes": (amplitudes, 4, 0, 16),
    "qaoa": (qaoa, 4, 0, 4),
}


def names(prefix: str, count: int) -> Iterator[str]:
    return (f"{prefix}{i}" for i in range(count))


def program_of(name: str) -> Program:
    make, width, inputs, parameters = CIRCUITS[name]
    return Program.of([Circuit.of(make(), width)], inputs, parameters)


def by_qiskit(name: str, values: dict[str, float]) -> QuantumCircuit:
    """The circuit with numbers, from the list of gates and not from our IR."""
    make, width, *_ = CIRCUITS[name]
    built = QuantumCircuit(width)
    for gate, *words in make():
        angles = [w for w in words if isinstance(w, str)]
        qubits = [w for w in words if isinstance(w, int)]
        numbers = [
            2 * values[word.removeprefix("2*")] if word.startswith("2*") else values[word]
            for word in angles
        ]
        getattr(built, str(gate))(*numbers, *qubits)
    return built


def machine(coupling: str, *, rx: bool = False) -> Device:
    """fake_jakarta with this coupling in place of cx and, if asked for, rx in place of sx and x."""
    values = load_device("fake_jakarta").model_dump()
    for each in values["couplings"]:
        each["gate"] = coupling
    if rx:
        for qubit in values["qubits"]:
            sx = qubit["gates"].pop("sx")
            qubit["gates"].pop("x", None)
            qubit["gates"]["rx"] = sx
        values["basis_gates"] = ["id", "rz", "rx"]
    return Device.model_validate(values)


MACHINES = {
    "cz": machine("cz"),
    "cx": machine("cx"),
    "ecr": machine("ecr"),
    "rx": machine("cz", rx=True),
}
BASES = {
    "cz": ["rz", "sx", "x", "cz"],
    "cx": ["rz", "sx", "x", "cx"],
    "ecr": ["rz", "sx", "x", "ecr"],
    "rx": ["rz", "rx", "rzz"],
}


def native_circuit(executable: Executable, x: np.ndarray, theta: np.ndarray) -> QuantumCircuit:
    (circuit,) = executable.native.circuits
    angles = iter(executable.bind(x[None], theta)[0].tolist())
    built = QuantumCircuit(circuit.width)
    for gate in circuit.gates:
        words = () if gate.angle is None else (next(angles),)
        getattr(built, gate.name)(*words, *gate.qubits)
    return built


@pytest.mark.parametrize("kind", MACHINES)
@pytest.mark.parametrize("name", CIRCUITS)
def test_compiled_circuits_keep_what_their_level_says(name: str, kind: str) -> None:
    program, device = program_of(name), MACHINES[kind]
    rng = np.random.default_rng(len(name))
    x = rng.uniform(-4, 4, len(program.inputs))
    theta = rng.uniform(-4, 4, len(program.parameters))
    values = dict(zip(program.symbols, [*x, *theta], strict=True))
    expected = Statevector(by_qiskit(name, values))
    width = program.bits
    for level in (0, 1, 2):
        executable = qcompile.compile(program, device, level)
        names_used = {gate.name for gate in executable.native.circuits[0].gates}
        assert names_used <= {*BASES[kind], device.coupling_gates[0]}
        built = native_circuit(executable, x, theta)
        p = Statevector(built).probabilities(list(range(width)))
        np.testing.assert_allclose(p, expected.probabilities(), atol=1e-10)
    unplaced = qcompile.compile(program, level=1)
    found = Operator(native_circuit(unplaced, x, theta)).data
    overlap = np.vdot(Operator(by_qiskit(name, values)).data, found) / 2**width
    assert abs(abs(overlap) - 1) < 1e-10


@pytest.mark.parametrize("kind", BASES)
@pytest.mark.parametrize("name", CIRCUITS)
def test_bound_late_they_are_what_qiskit_transpiled(name: str, kind: str) -> None:
    from qiskit.circuit import Parameter

    program = program_of(name)
    parameters = {symbol: Parameter(symbol) for symbol in program.symbols}
    circuit = transpile(
        by_qiskit(name, parameters),  # type: ignore[arg-type]
        basis_gates=BASES[kind],
        coupling_map=[[0, 1], [1, 2], [2, 3], [1, 0], [2, 1], [3, 2]],
        optimization_level=1,
        seed_transpiler=0,
    )
    bound = qcompile.qiskit.late(circuit)
    assert set(bound.circuit.count_ops()) <= {*BASES[kind]}
    values = np.random.default_rng(1).uniform(-4, 4, (3, circuit.num_parameters))
    for row, angles in zip(values, bound.angles(values), strict=True):
        expected = Statevector(circuit.assign_parameters(row))
        found = Statevector(bound.circuit.assign_parameters(angles))
        assert abs(abs(expected.inner(found)) - 1) < 1e-10


def test_the_library_circuits_are_those_of_qiskit() -> None:
    for name, made in (
        ("efficient_su2", efficient_su2(4, reps=2)),
        ("real_amplitudes", real_amplitudes(4, reps=3)),
    ):
        count = made.num_parameters
        theta = np.random.default_rng(0).uniform(-3, 3, count)
        ours = Operator(by_qiskit(name, dict(zip(names("theta", count), theta, strict=True))))
        assert ours.equiv(Operator(made.assign_parameters(theta)))


def test_noise_free_observables_are_those_of_the_state() -> None:
    program = program_of("jerbi")
    rng = np.random.default_rng(3)
    x, theta = rng.uniform(-2, 2, (1, 4)), rng.uniform(-3, 3, 16)
    values = dict(zip(program.symbols, [*x[0], *theta], strict=True))
    state = Statevector(by_qiskit("jerbi", values))
    executable = qcompile.compile(program)
    found = qcompile.OfflineExecutor(executable.device).expectation(executable, x, theta)
    for qubit in range(4):
        z = SparsePauliOp.from_sparse_list([("Z", [qubit], 1.0)], 4)
        assert abs(found[0, qubit] - state.expectation_value(z).real) < 1e-10
