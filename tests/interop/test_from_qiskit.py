"""Qiskit circuits as programs: `<Z>` of every qubit agrees with Qiskit's state vector."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from qiskit.circuit import Gate, Parameter, ParameterVector, QuantumCircuit
from qiskit.circuit.library import UnitaryGate
from qiskit.quantum_info import Operator, SparsePauliOp, Statevector, random_unitary

from qcompile.errors import CircuitError, MissingExtraError
from qcompile.ir import Program
from qcompile.simulate import Simulator

ONE_QUBIT = {
    **dict.fromkeys(["h", "x", "y", "z", "s", "sdg", "t", "tdg", "sx", "sxdg", "id"], 0),
    **dict.fromkeys(["rx", "ry", "rz", "p"], 1),
    "r": 2,
    "u": 3,
}
"""Methods of QuantumCircuit, and how many angles they take."""


def qiskit_z(circuit: QuantumCircuit, values: dict[Any, float]) -> np.ndarray:
    """`<Z>` of each qubit, by Qiskit."""
    bare = circuit.remove_final_measurements(inplace=False)
    state = Statevector(bare.assign_parameters(values) if values else bare)
    n = circuit.num_qubits
    return np.array(
        [state.expectation_value(SparsePauliOp("Z"), [qubit]).real for qubit in range(n)]
    )


def z(program: Program, values: dict[str, float]) -> np.ndarray:
    """`<Z>` of each circuit with a value for every symbol."""
    x = np.array([[values[name] for name in program.inputs]])
    theta = np.array([values[name] for name in program.parameters])
    return np.asarray(Simulator(program).expectation(x, theta))[0]


def same(circuit: QuantumCircuit, program: Program, symbol: Callable[[str], str] = str) -> None:
    """The program means what the circuit means, at three points."""
    rng = np.random.default_rng(1)
    for _ in range(3):
        values = {p: float(rng.uniform(-4, 4)) for p in circuit.parameters}
        by_symbol = {symbol(p.name): v for p, v in values.items()}
        np.testing.assert_allclose(z(program, by_symbol), qiskit_z(circuit, values), atol=1e-9)


def plain(name: str) -> str:
    return name.replace("[", "").replace("]", "")


def test_a_layer_of_four_circuits() -> None:
    circuit = QuantumCircuit(4)
    x, theta = ParameterVector("x", 4), ParameterVector("theta", 8)
    for i in range(4):
        circuit.ry(x[i], i)
        circuit.rz(theta[2 * i], i)
        circuit.ry(theta[2 * i + 1], i)
    program = Program.from_qiskit(circuit)
    assert program.inputs == ("x0", "x1", "x2", "x3")
    assert str(program.circuits[1]) == "ry(x1) rz(theta2) ry(theta3)"
    same(circuit, program, plain)


def test_scaled_inputs_are_uploaded_again() -> None:
    x, a, b = Parameter("x"), Parameter("a"), Parameter("b")
    circuit = QuantumCircuit(1)
    circuit.ry(1.7 * x, 0)
    circuit.rz(a / 2 - 0.25, 0)
    circuit.ry(-(0.6 * x + b) + np.pi, 0)
    program = Program.from_qiskit(circuit)
    assert (program.inputs, program.parameters) == (("x",), ("a", "b"))
    same(circuit, program)


@pytest.mark.parametrize("seed", range(4))
def test_random_circuits_of_all_gates(seed: int) -> None:
    rng = np.random.default_rng(seed)
    symbols = [Parameter("x0"), Parameter("theta0"), Parameter("theta1")]
    circuit = QuantumCircuit(2, global_phase=symbols[1])
    for name in rng.permutation([*ONE_QUBIT] * 3):
        angles = [
            round(rng.uniform(-2, 2), 3) * symbols[rng.integers(3)] + rng.uniform(-3, 3)
            for _ in range(ONE_QUBIT[name])
        ]
        getattr(circuit, name)(*angles, int(rng.integers(2)))
    circuit.barrier()
    circuit.append(UnitaryGate(random_unitary(2, seed)), [0])
    same(circuit, Program.from_qiskit(circuit))


def test_gates_of_old_files() -> None:
    from qiskit.circuit.library import U1Gate, U2Gate, U3Gate

    a, b = Parameter("a"), Parameter("b")
    circuit = QuantumCircuit(1)
    for gate in (U2Gate(a, b), U1Gate(b), U3Gate(b, 0.3, a)):
        circuit.append(gate, [0])
    same(circuit, Program.from_qiskit(circuit))


def test_vectors_and_numbered_names_are_ordered_by_their_numbers() -> None:
    x, circuit = ParameterVector("x", 12), QuantumCircuit(12)
    for i in reversed(range(12)):
        circuit.ry(x[i], i)
        circuit.rx(Parameter(f"theta{i}"), i)
    program = Program.from_qiskit(circuit)
    assert program.inputs == tuple(f"x{i}" for i in range(12))
    assert program.parameters == tuple(f"theta{i}" for i in range(12))
    angles = np.arange(12) / 4
    found = Simulator(program).expectation(angles[None], np.zeros(12))
    np.testing.assert_allclose(found[0], np.cos(angles), atol=1e-12)


def test_inputs_are_chosen() -> None:
    w, s = ParameterVector("w", 3), Parameter("scale")
    circuit = QuantumCircuit(1)
    for angle in (w[0], w[2], s):
        circuit.ry(angle, 0)
    ways: list[tuple[Any, tuple[str, ...], tuple[str, ...]]] = [
        (None, (), ("scale", "w0", "w2")),
        ("w", ("w0", "w2"), ("scale",)),
        (["w"], ("w0", "w2"), ("scale",)),
        (w, ("w0", "w1", "w2"), ("scale",)),
        (s, ("scale",), ("w0", "w2")),
        ([w[2], "scale", "w[0]"], ("w2", "scale", "w0"), ()),
        ([], (), ("scale", "w0", "w2")),
    ]
    for inputs, own, trained in ways:
        program = Program.from_qiskit(circuit, inputs=inputs)
        assert (program.inputs, program.parameters) == (own, trained), inputs


def test_names_that_cannot_be_symbols() -> None:
    circuit = QuantumCircuit(1)
    vector = ParameterVector("x", 1)
    for parameter in (vector[0], *map(Parameter, ["x0", "pi", "2 a", "$\\theta$", "λ"])):
        circuit.ry(parameter, 0)
    program = Program.from_qiskit(circuit)
    assert program.inputs == ("x0", "x0_")
    assert set(program.parameters) == {"pi_", "_2_a", "__theta_", "λ"}


def test_gates_of_ones_own_are_written_out() -> None:
    a, x = Parameter("a"), Parameter("x")
    inner = QuantumCircuit(2, name="layer")
    inner.ry(a, 0)
    inner.u(a, 0.2, -a, 1)
    gate = inner.to_gate({a: 2 * x})
    own = Gate("h", 1, [])  # named like a gate that it is not
    own.definition = QuantumCircuit(1)
    own.definition.rx(0.4, 0)
    circuit = QuantumCircuit(3)
    circuit.append(gate, [2, 0])
    circuit.append(gate.inverse(), [1, 2])
    circuit.append(own, [1])
    circuit.pauli("XYZ", [0, 1, 2])
    same(circuit, Program.from_qiskit(circuit))


def test_measured_qubits_are_ordered_by_their_bits() -> None:
    circuit = QuantumCircuit(4, 5)
    for qubit in range(4):
        circuit.ry(0.1 * (qubit + 1), qubit)
    circuit.barrier()
    circuit.measure([2, 0, 3], [0, 4, 1])
    program = Program.from_qiskit(circuit)
    np.testing.assert_allclose(z(program, {}), np.cos([0.3, 0.4, 0.1]), atol=1e-12)
    circuit.measure_all()  # a gate behind a measurement, for some
    with pytest.raises(CircuitError, match="measure on qubit 0 comes after the measurement"):
        Program.from_qiskit(circuit)


X, THETA = Parameter("x"), Parameter("theta")


def joining() -> QuantumCircuit:
    inner = QuantumCircuit(2, name="pair")
    inner.append(Gate("mine", 2, []), [1, 0])
    return inner


def branch(circuit: QuantumCircuit) -> None:
    with circuit.if_test((circuit.clbits[0], 1)):
        circuit.x(0)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (
            lambda c: c.append(joining(), [0, 1]),
            r"mine on qubits 1, 0 \(within pair\) is not a gate",
        ),
        (lambda c: (c.measure(1, 1), c.cx(0, 1)), "cx on qubits 0, 1 comes after the measurement"),
        (lambda c: c.reset(1), "reset on qubit 1 is not a gate"),
        (lambda c: (c.measure(0, 0), c.x(0)), "x on qubit 0 comes after the measurement"),
        (lambda c: c.measure([0, 1], [1, 1]), "measure of qubit 1 writes bit 1, which another"),
        (branch, "if_else on qubit 0 is not a gate"),
        (lambda c: c.append(Gate("mine", 1, []), [0]), "mine on qubit 0 is not a gate"),
        (lambda c: c.ry(X * THETA, 0), r"theta\*x is not an affine angle(.|\n)*0.5\*x0\+theta0"),
        (lambda c: c.ry(X.sin(), 0), "not an affine angle"),
        (lambda c: c.ry(X.sign(), 0), "not an affine angle"),
        (lambda c: c.ry(1 / X, 0), "not an affine angle"),
        (lambda c: c.ry(1j * X, 0), "is not real"),
    ],
)
def test_unsupported_circuits_are_refused(
    build: Callable[[QuantumCircuit], Any], words: str
) -> None:
    circuit = QuantumCircuit(2, 2)
    build(circuit)
    with pytest.raises(CircuitError, match=words):
        Program.from_qiskit(circuit)


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ("obs", r"No parameter starts with 'obs'\.\n  Its parameters: theta, x\."),
        (["y"], "inputs names 'y', which the circuit does not have"),
        (["x", X], "inputs names 'x' twice"),
    ],
)
def test_inputs_that_are_not_there(inputs: Any, words: str) -> None:
    circuit = QuantumCircuit(1)
    circuit.ry(X + THETA, 0)
    with pytest.raises(CircuitError, match=words):
        Program.from_qiskit(circuit, inputs=inputs)


def test_angles_whose_parameters_are_gone_are_numbers() -> None:
    circuit = QuantumCircuit(1)
    circuit.ry(2 * X + 1, 0)
    circuit.rx(THETA - THETA, 0)
    program = Program.from_qiskit(circuit.assign_parameters({X: 0.5}))
    assert str(program.circuits[0]) == "ry(2.0) rx(0.0)"


def test_qiskit_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "qiskit.circuit", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'qcompile\[qiskit\]'"):
        Program.from_qiskit(QuantumCircuit(1))


def test_other_objects_are_refused() -> None:
    with pytest.raises(CircuitError, match="takes a QuantumCircuit, found an object of type Oper"):
        Program.from_qiskit(Operator([[1, 0], [0, 1]]))
