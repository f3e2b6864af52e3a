"""Circuits of several qubits from Qiskit and OpenQASM: operators, order, observables, inputs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit, qasm3
from qiskit.circuit import Gate, Parameter, ParameterVector
from qiskit.circuit.library import (
    CXGate,
    QFTGate,
    RZZGate,
    UnitaryGate,
    XGate,
    efficient_su2,
)
from qiskit.quantum_info import Operator, Pauli, Statevector, random_unitary
from several import difference, expectations, program_operator, random_qiskit

from qcompile.errors import CircuitError
from qcompile.interop.openqasm import uploads_of as uploads_of_qasm
from qcompile.interop.qiskit import uploads_of
from qcompile.ir import Program
from qcompile.policy import Ansatz


def bits_of(program: Program) -> dict[int, int]:
    """The measured qubit, by its number, of every bit of a program whose observables are those."""
    return {bit: qubit for qubit, (bit,) in enumerate(program.measured)}


def z_of(circuit: QuantumCircuit, qubits: list[int]) -> np.ndarray:
    state = Statevector(circuit.remove_final_measurements(inplace=False))
    return np.array([state.expectation_value(Pauli("Z"), [qubit]).real for qubit in qubits])


@pytest.mark.parametrize("seed", range(60))
def test_the_operator_is_that_of_the_circuit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    circuit = random_qiskit(rng, count)
    program = Program.from_qiskit(circuit)
    found = program_operator(program, [bits_of(program)[bit] for bit in range(count)], count)
    assert difference(found, Operator(circuit).data) < 1e-10
    again = Program.from_qasm(qasm3.dumps(circuit))
    assert (again.widths, again.observables) == (program.widths, program.observables)


@pytest.mark.parametrize("seed", range(20))
def test_column_j_is_still_the_qubit_of_the_jth_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    circuit = QuantumCircuit(5, 6)
    circuit.compose(random_qiskit(rng, 5, 9), inplace=True)
    circuit.ry(0.3, range(5))
    some = int(rng.integers(1, 6))
    qubits, bits = (rng.choice(n, some, False).tolist() for n in (5, 6))
    circuit.measure(qubits, bits)
    in_order = [qubit for _, qubit in sorted(zip(bits, qubits, strict=True))]
    wanted = z_of(circuit, in_order)
    for program in (Program.from_qiskit(circuit), Program.from_qasm(qasm3.dumps(circuit))):
        assert all(len(observable) == 1 for observable in program.measured)
        np.testing.assert_allclose(expectations(program, {}), wanted, atol=1e-10)


def test_circuits_come_in_the_order_of_their_first_measured_qubit() -> None:
    circuit = QuantumCircuit(6, 6)
    circuit.cx(0, 4)
    circuit.h(1)
    circuit.cz(5, 2)
    circuit.x(3)
    circuit.cx(2, 5)
    circuit.measure([2, 1, 4], [0, 1, 3])
    program = Program.from_qiskit(circuit)
    assert list(map(str, program.circuits)) == ["cz@1,0 cx@0,1", "h", "cx@1,0"]
    assert program.observables == ((0,), (2,), (3,))
    measured = Program.from_qasm(qasm3.dumps(circuit))
    assert measured == program
    circuit.measure([0, 5], [4, 2])
    program = Program.from_qiskit(circuit)
    assert list(map(str, program.circuits)) == ["cz@1,0 cx@0,1", "h", "cx@1,0"]
    assert program.observables == ((0,), (2,), (1,), (3,), (4,))


def test_without_a_measurement_column_j_is_qubit_j() -> None:
    circuit = QuantumCircuit(4)
    circuit.ry(0.3, 0)
    circuit.cx(0, 2)
    circuit.ry(0.5, 1)
    circuit.cx(1, 3)
    for program in (Program.from_qiskit(circuit), Program.from_qasm(qasm3.dumps(circuit))):
        assert program.observables == ((0,), (2,), (1,), (3,))
        np.testing.assert_allclose(expectations(program, {}), z_of(circuit, [0, 1, 2, 3]))
    circuit.swap(1, 2)
    program = Program.from_qiskit(circuit)
    assert (program.widths, program.observables) == ((4,), ())


def test_angles_on_several_qubits_depend_on_inputs() -> None:
    x, theta = ParameterVector("x", 2), ParameterVector("theta", 2)
    circuit = QuantumCircuit(3)
    circuit.h(range(3))
    circuit.cp(2 * x[0] - theta[1], 0, 1)
    circuit.crx(x[1] / 3, 1, 2)
    circuit.rxx(theta[0] + 0.25, 2, 0)
    circuit.cu(x[0], theta[0], -x[1], theta[1], 0, 2)
    circuit.append(RZZGate(x[0]).control(1, ctrl_state=0), [0, 1, 2])
    circuit.ry(0.4, range(3))
    program = Program.from_qiskit(circuit)
    assert program.inputs == ("x0", "x1")
    rng = np.random.default_rng(0)
    for _ in range(3):
        values = {p: float(rng.uniform(-4, 4)) for p in circuit.parameters}
        named = {p.name.replace("[", "").replace("]", ""): v for p, v in values.items()}
        wanted = z_of(circuit.assign_parameters(values), [0, 1, 2])
        np.testing.assert_allclose(expectations(program, named), wanted, atol=1e-10)


def test_gates_of_ones_own_and_of_the_library() -> None:
    inner = QuantumCircuit(2, name="pair")
    inner.ry(0.2, 1)
    inner.ch(1, 0)
    own = Gate("cx", 2, [])  # named like a gate that it is not
    own.definition = QuantumCircuit(2)
    own.definition.rzx(0.4, 1, 0)
    circuit = QuantumCircuit(5)
    circuit.append(inner.to_gate(), [4, 0])
    circuit.append(inner.to_gate().inverse(), [1, 4])
    circuit.append(own, [1, 2])
    circuit.append(CXGate(ctrl_state=0), [2, 3])
    circuit.append(XGate().control(4, ctrl_state=0b0110, annotated=False), range(5))
    circuit.append(UnitaryGate(random_unitary(4, 1)), [3, 1])
    circuit.append(UnitaryGate(random_unitary(8, 2)), [0, 3, 2])
    circuit.append(QFTGate(3), [2, 4, 1])
    circuit.mcp(0.7, [0, 1, 2], 3)
    circuit.compose(efficient_su2(5, reps=1).assign_parameters(np.linspace(0, 3, 20)), inplace=True)
    program = Program.from_qiskit(circuit)
    assert program.widths == (5,)
    assert difference(program_operator(program, range(5), 5), Operator(circuit).data) < 1e-9


X, A, B = Parameter("x0"), Parameter("a"), Parameter("b")


def uploading() -> QuantumCircuit:
    circuit = QuantumCircuit(3)
    for qubit in range(3):
        circuit.ry(A * X + B, qubit)
    circuit.crz(2 * X * B - A / 2, 0, 1)
    circuit.rzz(X * A, 1, 2)
    circuit.h(range(3))
    return circuit


@pytest.mark.parametrize("way", ["object", "qasm"])
def test_products_of_inputs_and_parameters_are_uploaded(way: str) -> None:
    circuit: Any = uploading()
    uploads = uploads_of(circuit) if way == "object" else uploads_of_qasm(qasm3.dumps(circuit))
    assert (uploads.inputs, uploads.parameters) == (("x0",), ("a", "b"))
    assert sorted(uploads.products) == [(0, 0), (0, 1)]
    assert uploads.program.widths == (3,)
    values = {X: 0.7, A: -1.2, B: 0.4}
    named = {"x0": 0.7, "a": -1.2, "b": 0.4}
    for name, (_, parameter) in zip(uploads.program.inputs[1:], uploads.products, strict=True):
        named[name] = 0.7 * (-1.2, 0.4)[parameter]
    wanted = z_of(circuit.assign_parameters(values), [0, 1, 2])
    np.testing.assert_allclose(expectations(uploads.program, named), wanted, atol=1e-10)


def test_a_gate_without_a_meaning_is_named() -> None:
    circuit = QuantumCircuit(2)
    circuit.append(Gate("magic", 2, []), [1, 0])
    with pytest.raises(CircuitError) as caught:
        Program.from_qiskit(circuit)
    assert str(caught.value).splitlines() == [
        "magic on qubits 1, 0 is not a gate that qcompile can compile.",
        "  Circuits may contain standard gates, gates made of them, and measurements at the end.",
        "  Remove it, or replace it with standard gates.",
    ]


def test_circuits_to_train_keep_their_observables() -> None:
    circuit = QuantumCircuit(3, 3)
    circuit.compose(uploading(), inplace=True)
    circuit.measure([2, 0, 1], [0, 1, 2])
    for ansatz in (Ansatz.from_qiskit(circuit), Ansatz.from_qasm(qasm3.dumps(circuit))):
        assert ansatz.program.widths == (3,)
        assert (ansatz.inputs, ansatz.parameters) == (("x0",), ("a", "b"))
        values = {"x0": 0.7 * -1.2, "x1": 0.7 * 0.4, "theta0": -1.2, "theta1": 0.4}
        assert ansatz.factors.tolist() == [0, 1]
        wanted = z_of(circuit.assign_parameters({X: 0.7, A: -1.2, B: 0.4}), [2, 0, 1])
        np.testing.assert_allclose(expectations(ansatz.program, values), wanted, atol=1e-10)
