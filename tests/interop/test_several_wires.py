"""Quantum functions on several wires: operators, products of Z, templates, by PennyLane."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from qiskit.quantum_info import Operator
from several import difference, expectations, program_operator

from qcompile.errors import CircuitError
from qcompile.interop.pennylane import uploads_of
from qcompile.ir import Program

qml = pytest.importorskip("pennylane")

FIXED = "Hadamard X Y Z S T SX".split()  # noqa: SIM905
TURNS = "RX RY RZ PhaseShift".split()  # noqa: SIM905
PAIRS = "CNOT CZ CY CH SWAP ISWAP ECR SISWAP".split()  # noqa: SIM905
TURNED_PAIRS = """
    CRX CRY CRZ ControlledPhaseShift CPhaseShift00 CPhaseShift01 CPhaseShift10 IsingXX IsingYY
    IsingZZ IsingXY PSWAP SingleExcitation
""".split()  # noqa: SIM905
TRIPLES = "Toffoli CCZ CSWAP".split()  # noqa: SIM905


def random_operation(rng: np.random.Generator, count: int) -> Any:
    wires, angle = rng.permutation(count).tolist(), float(rng.uniform(-4, 4))
    match int(rng.integers(7)):
        case 0:
            return getattr(qml, str(rng.choice(FIXED)))(wires[0])
        case 1:
            return getattr(qml, str(rng.choice(TURNS)))(angle, wires[0])
        case 2:
            return qml.Rot(angle, angle / 2, -angle, wires=wires[0])
        case 3:
            return getattr(qml, str(rng.choice(PAIRS)))(wires[:2])
        case 4 | 5:
            return getattr(qml, str(rng.choice(TURNED_PAIRS)))(angle, wires[:2])
    if count < 3:
        return qml.CRot(angle, 0.2, 0.3, wires=wires[:2])
    return getattr(qml, str(rng.choice(TRIPLES)))(wires[:3])


def modified(rng: np.random.Generator, operation: Any, count: int) -> Any:
    free = [wire for wire in range(count) if wire not in operation.wires]
    if rng.random() < 0.2:
        return qml.adjoint(operation)
    if free and rng.random() < 0.3:
        some = free[: rng.integers(1, len(free) + 1)]
        values = [bool(value) for value in rng.integers(0, 2, len(some))]
        return qml.ctrl(operation, some, control_values=values)
    return operation


@pytest.mark.parametrize("seed", range(60))
def test_the_operator_is_that_of_the_tape(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 5))
    operations = [
        modified(rng, random_operation(rng, count), count) for _ in range(rng.integers(1, 10))
    ]
    first = [qml.I(wire) for wire in range(count)]
    program = Program.from_pennylane(qml.tape.QuantumScript([*first, *operations]))
    wanted = qml.matrix(qml.tape.QuantumScript(operations, [qml.state()]), range(count))
    qubit_of = {bit: wire for wire, (bit,) in enumerate(program.measured)}
    ours = program_operator(program, [qubit_of[bit] for bit in range(count)], count)
    assert difference(Operator(ours).reverse_qargs().data, wanted) < 1e-10


def found(program: Program, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    names = (*program.inputs, *program.parameters)
    return expectations(program, dict(zip(names, (*x, *theta.ravel()), strict=True)))


def test_products_of_z_are_observables() -> None:
    @qml.qnode(qml.device("default.qubit"))
    def node(x: Any, theta: Any) -> Any:
        qml.AngleEmbedding(x, wires=range(3), rotation="Y")
        qml.StronglyEntanglingLayers(theta, wires=range(3))
        qml.RY(x[0] / 2 - theta[1, 2, 0], wires="alone")
        return (
            qml.expval(qml.Z(2) @ qml.Z(0)),
            qml.expval(qml.Z("alone")),
            qml.expval(qml.Z(1)),
            qml.expval(qml.prod(qml.Z(0), qml.Z(1), qml.Z(2))),
        )

    program = Program.from_pennylane(node, inputs=3, parameters=(2, 3, 3))
    assert program.widths == (3, 1)
    assert program.observables == ((0, 1), (3,), (2,), (0, 1, 2))
    rng = np.random.default_rng(0)
    for _ in range(3):
        x, theta = rng.uniform(-3, 3, 3), rng.uniform(-3, 3, (2, 3, 3))
        wanted = np.array(node(x, theta), dtype=float)
        np.testing.assert_allclose(found(program, x, theta), wanted, atol=1e-9)


def test_wires_of_samples_are_bits_in_their_order() -> None:
    def body() -> Any:
        qml.RY(0.3, wires="a")
        qml.CNOT(["a", "b"])
        qml.RX(0.2, wires="b")
        qml.Hadamard("c")
        qml.CZ(["b", "d"])
        return qml.probs(wires=["b", "c", "a"])

    program = Program.from_pennylane(body)
    assert program.observables == ((0,), (3,), (1,))
    assert list(map(str, program.circuits)) == ["ry(0.3)@1 cx@1,0 rx(0.2)@0 cz@0,2", "h"]


def test_templates_and_matrices_are_written_out() -> None:
    unitary = np.linalg.qr(np.random.default_rng(1).normal(size=(4, 4)))[0]

    @qml.qnode(qml.device("default.qubit"))
    def node(x: Any) -> Any:
        qml.IQPEmbedding(x, wires=range(3))
        qml.QubitUnitary(unitary, wires=[2, 0])
        qml.QFT(wires=range(3))
        qml.PauliRot(x[1], "XYZ", wires=range(3))
        qml.MultiControlledX(wires=[0, 1, 2, 3], control_values=[1, 0, 1])
        qml.GroverOperator(wires=range(4))
        qml.BasicEntanglerLayers(x.reshape(1, 3), wires=range(3))
        return [qml.expval(qml.Z(wire)) for wire in range(4)]

    def embedded(x: Any) -> Any:
        """Without the products of features of the embedding, which are not affine."""
        for wire in range(3):
            qml.RY(x[wire], wires=wire)
        qml.QubitUnitary(unitary, wires=[2, 0])
        qml.QFT(wires=range(3))
        qml.PauliRot(x[1], "XYZ", wires=range(3))
        qml.MultiControlledX(wires=[0, 1, 2, 3], control_values=[1, 0, 1])
        qml.GroverOperator(wires=range(4))
        qml.BasicEntanglerLayers(x.reshape(1, 3), wires=range(3))
        return [qml.expval(qml.Z(wire)) for wire in range(4)]

    with pytest.raises(CircuitError, match="not an affine angle"):
        Program.from_pennylane(node, inputs=3)
    program = Program.from_pennylane(embedded, inputs=3)
    theirs = qml.QNode(embedded, qml.device("default.qubit"))
    x = np.array([0.3, -1.1, 2.0])
    wanted = np.array(theirs(x), dtype=float)
    np.testing.assert_allclose(found(program, x, np.zeros(0)), wanted, atol=1e-9)


def test_products_of_inputs_and_parameters_are_uploaded() -> None:
    def body(x: Any, theta: Any) -> Any:
        qml.RY(x[0] * theta[0], wires=0)
        qml.CRX(x[1] * theta[1] + theta[0], wires=[0, 1])
        return qml.expval(qml.Z(0) @ qml.Z(1))

    uploads = uploads_of(body, 2, 2)
    assert uploads.program.observables == ((0, 1),)
    assert uploads.products == ((0, 0), (1, 1))


@pytest.mark.parametrize(
    ("measured", "words"),
    [
        (lambda: qml.expval(qml.Z(0) @ qml.Z(2)), "No gates connect the wires 0, 2, whose product"),
        (
            lambda: [qml.expval(qml.Z(0) @ qml.Z(1)), qml.expval(qml.Z(1) @ qml.Z(0))],
            "The product of wires 1, 0 is measured twice.",
        ),
        (lambda: [qml.expval(qml.Z(0)), qml.probs([1, 0])], "Wire 0 is measured twice."),
    ],
)
def test_observables_that_are_none_are_refused(measured: Any, words: str) -> None:
    def body() -> Any:
        qml.CNOT([0, 1])
        qml.RX(0.3, wires=2)
        return measured()

    with pytest.raises(CircuitError, match=words):
        Program.from_pennylane(body)
