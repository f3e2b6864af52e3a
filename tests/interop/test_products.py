r"""Trained factors of inputs: \`<Z>\` agrees with Qiskit and PennyLane."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from qiskit import qasm3
from qiskit.circuit import Parameter, ParameterVector, QuantumCircuit
from qiskit.quantum_info import SparsePauliOp, Statevector

from qcompile.errors import CircuitError, ProgramFileError
from qcompile.policy import Ansatz, load_ansatz
from qcompile.simulate import Simulator


def uploading(qubits: int = 2, layers: int = 2) -> QuantumCircuit:
    """Re-uploading with a factor and a shift for each layer and qubit; some factors are shared."""
    x = ParameterVector("x", qubits)
    s, t = ParameterVector("s", qubits * layers), ParameterVector("t", qubits * layers)
    circuit = QuantumCircuit(qubits)
    for layer in range(layers):
        for qubit in range(qubits):
            k = layer * qubits + qubit
            circuit.ry(s[k] * x[qubit] + t[k], qubit)
            circuit.rz(2 * (x[qubit] - 0.5) * (s[0] + 0.25) - t[k] / 3, qubit)
            circuit.rx(0.6 * x[0], qubit)
    return circuit


def z(ansatz: Ansatz, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """`<Z>` of each circuit (B, circuits) for the circuits' own inputs (B, inputs)."""
    factors = np.append(theta, 1.0)[ansatz.factors]
    values = x[:, ansatz.reads] * factors
    return np.asarray(Simulator(ansatz.program).expectation(values, theta))


def qiskit_z(circuit: QuantumCircuit, values: dict[str, float]) -> list[float]:
    state = Statevector(circuit.assign_parameters(values))
    qubits = range(circuit.num_qubits)
    return [state.expectation_value(SparsePauliOp("Z"), [qubit]).real for qubit in qubits]


@pytest.mark.parametrize(
    "read", [Ansatz.from_qiskit, lambda c: Ansatz.from_qasm(qasm3.dumps(c))], ids=["object", "qasm"]
)
def test_products_agree_with_qiskit(read: Callable[[Any], Ansatz]) -> None:
    circuit = uploading()
    ansatz = read(circuit)
    assert (len(ansatz.inputs), len(ansatz.parameters)) == (2, 8)
    assert len(ansatz.program.inputs) == 2 + 5  # each input alone; s0 x0, s0 x1, and s1 to s3
    rng = np.random.default_rng(0)
    x, theta = rng.uniform(-2, 2, (3, 2)), rng.uniform(-2, 2, 8)
    names = [f"s[{k}]" for k in range(4)] + [f"t[{k}]" for k in range(4)]
    for row, found in zip(x, z(ansatz, x, theta), strict=True):
        values = dict(zip([*names, "x[0]", "x[1]"], [*theta, *row], strict=True))
        np.testing.assert_allclose(found, qiskit_z(circuit, values), atol=1e-9)


def test_names_are_those_of_the_circuit() -> None:
    ansatz = Ansatz.from_qiskit(uploading(1, 1))
    assert (ansatz.inputs, ansatz.parameters) == (("x[0]",), ("s[0]", "t[0]"))
    assert str(ansatz).splitlines()[2].startswith("0: ry(t[0]+s[0]*x[0]) rz(")
    assert repr(ansatz) == "Ansatz(1 circuit, 1 input, 2 parameters, of a Qiskit circuit)"


def test_inputs_that_only_products_read_are_not_bound_alone() -> None:
    s, x = Parameter("s"), ParameterVector("x", 2)
    circuit = QuantumCircuit(1)
    circuit.ry(s * x[1], 0)
    ansatz = Ansatz.from_qiskit(circuit, inputs=x)
    assert ansatz.inputs == ("x[0]", "x[1]")
    assert (ansatz.reads.tolist(), ansatz.factors.tolist()) == ([1], [0])
    assert str(ansatz.program.circuits[0]) == "ry(x0)"


def test_products_agree_with_pennylane() -> None:
    qml = pytest.importorskip("pennylane")

    @qml.qnode(qml.device("default.qubit"))
    def node(x: Any, theta: Any) -> Any:
        for wire in range(2):
            qml.RY(theta[0, wire] * x[wire] + theta[1, wire], wires=wire)
            qml.Rot(x[0] / 2, -theta[2, wire] * (x[wire] - 1), theta[0, wire], wires=wire)
        return [qml.expval(qml.Z(wire)) for wire in range(2)]

    ansatz = Ansatz.from_pennylane(node, inputs=2, parameters=(3, 2))
    rng = np.random.default_rng(1)
    x, theta = rng.uniform(-2, 2, (3, 2)), rng.uniform(-2, 2, (3, 2))
    for row, found in zip(x, z(ansatz, x, theta.ravel()), strict=True):
        np.testing.assert_allclose(found, np.array(node(row, theta)), atol=1e-9)


X, A, B = Parameter("x"), Parameter("a"), Parameter("b")


@pytest.mark.parametrize(
    "angle", [X * X, A * B, A * A * X, A * X * X, X.sin() * A, A / X, X * A / (A + 1)], ids=str
)
def test_other_products_are_refused(angle: Any) -> None:
    circuit = QuantumCircuit(1)
    circuit.ry(angle + 0 * (X + A + B), 0)
    with pytest.raises(CircuitError, match=r"not an affine angle(.|\n)*one parameter: theta1\*x0"):
        Ansatz.from_qiskit(circuit)


@pytest.mark.parametrize("angle", ["x * x", "a * a", "a * b", "a * x * a"])
def test_other_products_of_a_file_are_refused(angle: str) -> None:
    names = "".join(f"input float[64] {name};\n" for name in ("x", "a", "b"))
    text = f'OPENQASM 3.0;\ninclude "stdgates.inc";\n{names}qubit q;\nry({angle}) q;\n'
    with pytest.raises((CircuitError, ProgramFileError), match=r"affine|three symbols"):
        Ansatz.from_qasm(text)


def test_products_in_pennylane_are_refused_alike() -> None:
    qml = pytest.importorskip("pennylane")
    with pytest.raises(CircuitError, match=r"x0\*x0 is not an affine angle"):
        Ansatz.from_pennylane(lambda x: qml.RX(x[0] * x[0], 0), inputs=1)


def test_the_error_for_other_packages_suggests_a_call() -> None:
    qml = pytest.importorskip("pennylane")
    node = qml.QNode(lambda x: qml.expval(qml.Z(0)), qml.device("default.qubit"))
    with pytest.raises(CircuitError, match=r"Ansatz\.from_pennylane\(qnode, inputs=2"):
        load_ansatz(node)
