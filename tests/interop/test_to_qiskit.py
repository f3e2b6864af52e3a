"""Executables as Qiskit circuits, simulated by Qiskit."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from qiskit.circuit import ParameterVector, QuantumCircuit
from qiskit.quantum_info import SparsePauliOp, Statevector

from qcompile.deploy.deployment import Deployment
from qcompile.deploy.play import play
from qcompile.device import IDEAL, Device, Qubit, load_device
from qcompile.errors import CircuitError
from qcompile.execution import OfflineExecutor
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable, compile
from qcompile.policy import Encoder, Policy

PROGRAM = Program.of(
    map(Circuit.parse, ["h ry(x0) rz(theta0) rx(x1)", "ry(x1) rz(theta1) ry(x0)", "x"]),
    inputs=2,
    parameters=2,
)
X, THETA = np.array([0.3, -1.1]), np.array([0.7, 2.0])
PERFECT = Qubit(t1_us=1e12, t2_us=1e12, p10=0.0, p01=0.0)


def perfect(qubits: int, gates: tuple[str, ...] = ("rz", "sx", "x")) -> Device:
    return Device(name="perfect", source="test", basis_gates=gates, qubits=(PERFECT,) * qubits)


def qiskit_z(executable: Executable, circuits: list[QuantumCircuit]) -> np.ndarray:
    """`<Z>` of each circuit, on the qubit and in the round that the executable says."""
    states = [Statevector(c.remove_final_measurements(inplace=False)) for c in circuits]
    operator = SparsePauliOp("Z")
    return np.array(
        [
            states[index].expectation_value(operator, [int(qubit)]).real
            for index, qubit in zip(executable.rounds, executable.qubits, strict=True)
        ]
    )


@pytest.mark.parametrize("gates", [("rz", "sx", "x"), ("rz", "rx")])
@pytest.mark.parametrize("level", [0, 1, 2])
def test_bound_circuits_agree_with_the_executor(level: int, gates: tuple[str, ...]) -> None:
    executable = compile(PROGRAM, perfect(2, gates), level)
    ideal = compile(PROGRAM, IDEAL)
    wanted = OfflineExecutor(IDEAL).expectation(ideal, X[None], THETA)[0]
    circuits = executable.to_qiskit(X, THETA)
    assert len(circuits) == executable.round_count == 2
    np.testing.assert_allclose(qiskit_z(executable, circuits), wanted, atol=1e-9)
    assert {i.operation.name for c in circuits for i in c.data} <= {*gates, "measure", "id"}


def test_open_angles_have_the_values_of_bind() -> None:
    executable = compile(PROGRAM, perfect(4))
    circuits = executable.to_qiskit()
    names = {p.name for c in circuits for p in c.parameters}
    assert names == {f"a{i}_0" for i in executable.slot_circuits[executable.open_slots]}
    angles = executable.bind(X[None], THETA)[0]
    bound = [
        c.assign_parameters({p: angles[int(p.name[1:].split("_")[0])] for p in c.parameters})
        for c in circuits
    ]
    direct = executable.to_qiskit(X, THETA)
    np.testing.assert_allclose(
        qiskit_z(executable, bound), qiskit_z(executable, direct), atol=1e-12
    )


def test_registers_and_measurements() -> None:
    executable = compile(PROGRAM, load_device("fake_lima"))
    (circuit,) = executable.to_qiskit()
    assert (circuit.num_qubits, circuit.num_clbits, circuit.cregs[0].name) == (5, 3, "c")
    measured = {
        circuit.find_bit(i.clbits[0]).index: circuit.find_bit(i.qubits[0]).index
        for i in circuit.data
        if i.operation.name == "measure"
    }
    assert measured == dict(enumerate(executable.qubits))
    (bare,) = executable.to_qiskit(measure=False)
    assert (bare.num_clbits, bare.count_ops().get("measure")) == (0, None)
    (constant,) = compile(Program.of([Circuit.parse("x")]), perfect(2)).to_qiskit()
    assert not constant.parameters


def test_the_ideal_device_has_as_many_qubits_as_are_used() -> None:
    executable = compile(PROGRAM)
    (circuit,) = executable.to_qiskit(X, THETA)
    assert circuit.num_qubits == 3
    wanted = OfflineExecutor(IDEAL).expectation(executable, X[None], THETA)[0]
    np.testing.assert_allclose(qiskit_z(executable, [circuit]), wanted, atol=1e-9)


def test_x_without_theta_is_refused() -> None:
    executable = compile(PROGRAM, perfect(3))
    with pytest.raises(CircuitError, match="x was given without theta"):
        executable.to_qiskit(X)
    with pytest.raises(CircuitError, match="x has shape"):
        executable.to_qiskit(X[:1], THETA)


def pushed_right(seed: int) -> int:
    """How many steps CartPole lasts when it is always pushed to the right."""
    environment = gymnasium.make("CartPole-v1")
    environment.reset(seed=seed)
    steps = 1
    while not environment.step(1)[2]:
        steps += 1
    return steps


def test_a_circuit_of_qiskit_becomes_a_policy_that_plays() -> None:
    """It re-uploads its inputs, and on the noise model of a device it scores."""
    x, theta = ParameterVector("x", 4), ParameterVector("theta", 4)
    circuit = QuantumCircuit(4)
    for i in range(4):
        circuit.ry(1.7 * x[i], i)
        circuit.rz(theta[i], i)
        circuit.ry(0.6 * x[i], i)
    program = Program.from_qiskit(circuit)
    policy = Policy(
        "mine",
        "CartPole-v1",
        Encoder("arctan", np.arange(4), np.ones(4)),
        program,
        np.zeros(4),
        np.zeros((2, 4)),
        np.array([0.0, 100.0]),  # always pushes to the right
    )
    result = play(Deployment(policy, load_device("fake_lima"), shots=16), 2)
    np.testing.assert_array_equal(result.rewards, [pushed_right(0), pushed_right(1)])
