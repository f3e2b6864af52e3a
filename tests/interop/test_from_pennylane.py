"""Quantum functions as programs: `<Z>` agrees with PennyLane's simulator."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from qcompile.errors import CircuitError, MissingExtraError
from qcompile.ir import Program
from qcompile.simulate import Simulator

qml = pytest.importorskip("pennylane")

PARAMETERS = (2, 3)


def gates(x: Any, theta: Any) -> None:
    qml.AngleEmbedding(x, wires=range(2), rotation="Y")
    for wire in range(2):
        qml.Rot(*theta[wire], wires=wire)
        qml.RX(0.5 * x[wire] + np.pi / 3, wires=wire)
        qml.U3(theta[wire, 0], -theta[wire, 1], 0.2, wires=wire)
        qml.U2(theta[wire, 0] - x[0] / 3, theta[wire, 2], wires=wire)
    for gate in (qml.Hadamard, qml.X, qml.Y, qml.Z, qml.S, qml.T, qml.SX):
        gate(0)
        qml.RY(1 - x[1], wires=0)
        qml.adjoint(gate(0))
    qml.PhaseShift(np.float64(2.0) * x[1], wires=0)
    qml.RY(np.dot(np.array([1.0, -2.0]), x), wires=1)


def wrapped(x: Any, theta: Any) -> None:
    qml.RY(0.3, wires=0)
    qml.adjoint(qml.Rot)(*theta[0], wires=0)
    qml.adjoint(qml.U2)(x[0], theta[1, 1], wires=0)
    qml.prod(qml.RX(x[0], 0), qml.RY(x[1], 1))
    qml.pow(qml.RX(theta[0, 0], 1), 3)
    qml.QubitUnitary(np.array([[1, 1j], [1j, 1]]) / np.sqrt(2), wires=1)
    qml.PauliRot(x[1], "XI", wires=[0, 1])
    qml.GlobalPhase(x[0])
    qml.Barrier([0, 1])
    qml.BasisState(np.array([1, 0]), wires=[0, 1])


@pytest.mark.parametrize("body", [gates, wrapped])
def test_gates_agree_with_pennylane(body: Callable[..., None]) -> None:
    @qml.qnode(qml.device("default.qubit"))
    def node(x: Any, theta: Any) -> Any:
        body(x, theta)
        return [qml.expval(qml.Z(1)), qml.expval(qml.Z(0))]

    program = Program.from_pennylane(node, inputs=2, parameters=PARAMETERS)
    rng = np.random.default_rng(0)
    for _ in range(3):
        x, theta = rng.uniform(-3, 3, 2), rng.uniform(-3, 3, PARAMETERS)
        found = Simulator(program).expectation(x[None], theta.ravel())
        np.testing.assert_allclose(found[0], np.array(node(x, theta)), atol=1e-9)


def test_scales_are_exact() -> None:
    def body(x: Any, theta: Any) -> None:
        for wire in ("b", "a"):
            qml.RY(1.7 * x[0] - theta[1] + 1, wires=wire)

    program = Program.from_pennylane(body, 1, 2)
    assert list(map(str, program.circuits)) == ["ry(-theta1+1.7*x0+1.0)"] * 2
    assert (program.inputs, program.parameters) == (("x0",), ("theta0", "theta1"))


def rotated(wire: Any) -> None:
    qml.RY(0.1 * wire, wires=wire)


@pytest.mark.parametrize(
    ("measured", "wires"),
    [
        (lambda: qml.probs(wires=[3, 1]), [3, 1]),
        (lambda: qml.sample(wires=[2]), [2]),
        (lambda: qml.counts(), [2, 1, 3]),
        (lambda: (qml.expval(qml.Z(3)), qml.expval(qml.Z(2))), [3, 2]),
        (lambda: None, [2, 1, 3]),
        (lambda: qml.expval(qml.Z(7)), [7]),
    ],
)
def test_circuits_are_the_wires_that_are_measured(measured: Any, wires: list[int]) -> None:
    def body() -> Any:
        for wire in (2, 1, 3):
            rotated(wire)
        return measured()

    circuits = Program.from_pennylane(body).circuits
    wanted = [f"ry({0.1 * wire!r})" if wire < 7 else "" for wire in wires]
    assert list(map(str, circuits)) == wanted


def test_a_tape_is_a_program_of_numbers() -> None:
    tape = qml.tape.QuantumScript([qml.RX(0.3, 1), qml.Hadamard(0)], [qml.probs(wires=[1, 0])])
    assert str(Program.from_pennylane(tape)) == "inputs\nparameters\n0: rx(0.3)\n1: h"
    with pytest.raises(CircuitError, match="A tape contains only numbers"):
        Program.from_pennylane(tape, inputs=1)


def test_a_function_with_an_argument_bound_is_a_function() -> None:
    def body(x: Any, wire: int) -> None:
        qml.RX(x[0], wire)

    program = Program.from_pennylane(partial(body, wire=3), inputs=1)
    assert str(program.circuits[0]) == "rx(x0)"


def test_pennylane_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pennylane", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'qcompile\[pennylane\]'"):
        Program.from_pennylane(rotated, inputs=())


def test_scalars_are_given_alone() -> None:
    program = Program.from_pennylane(lambda x: qml.RX(2 * x, 0), inputs=())
    assert str(program.circuits[0]) == "rx(2.0*x0)"


def branches(x: Any, theta: Any) -> None:
    if x[0] > 0:
        qml.RX(x[0], 0)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (lambda x, t: qml.RX(np.arctan(x[0]), 0), r"arctan\(x0\) is not an affine angle"),
        (lambda x, t: qml.RX(x[0] * t[0], 0), r"\(x0\)\*\(theta0\) is not an affine angle"),
        (lambda x, t: qml.RX(1 / x[0], 0), "not an affine angle"),
        (lambda x, t: qml.RX(x[0] ** 2, 0), "not an affine angle"),
        (lambda x, t: qml.RX(x[0] % 3, 0), "not an affine angle"),
        (lambda x, t: qml.RX(abs(x[0]), 0), "not an affine angle"),
        (lambda x, t: qml.RX(x, 0), r"RX has an array of angles of shape \(2,\)"),
        (lambda x, t: qml.RX(float(x[0]), 0), "uses the value of x0"),
        (branches, "uses the value of x0"),
        (lambda x, t: (qml.RX(x[0], 0), qml.measure(0))[0], "is not a gate"),
        (lambda x, t: qml.expval(qml.X(0)), r"expval\(X\(0\)\) is not a product of Z"),
        (lambda x, t: qml.expval(qml.Z(0) @ qml.X(1)), "is not a product of Z"),
        (lambda x, t: qml.expval(qml.Z(0) @ qml.Z(0)), "is not a product of Z"),
        (lambda x, t: qml.expval(2 * qml.Z(0)), "is not a product of Z"),
        (lambda x, t: qml.expval(qml.Z(0) + qml.Z(1)), "is not a product of Z"),
        (lambda x, t: qml.expval(qml.Hermitian(np.eye(2), 0)), "is not a product of Z"),
        (lambda x, t: qml.expval(qml.Z(0) @ qml.Z(1)), "No gates connect the wires 0, 1"),
        (lambda x, t: qml.var(qml.Z(0)), "is not supported"),
        (lambda x, t: [qml.expval(qml.Z(0)), qml.probs(wires=[0])], "measured twice"),
        (lambda x: None, "cannot be called with symbols(.|\n)*x of shape 2 and theta of shape 6"),
    ],
)
def test_unsupported_functions_are_refused(body: Any, words: str) -> None:
    with pytest.raises(CircuitError, match=words):
        Program.from_pennylane(body, 2, 6)


def test_other_objects_are_refused() -> None:
    with pytest.raises(
        CircuitError, match="takes a quantum function, a QNode or a tape, found int"
    ):
        Program.from_pennylane(3)


@pytest.mark.parametrize("inputs", [None, -1, 1.5, "2", [1.5], {"a": 1}, 2**80])
def test_shapes_are_whole_numbers(inputs: Any) -> None:
    with pytest.raises(CircuitError, match="inputs cannot be"):
        Program.from_pennylane(lambda x: None, inputs=inputs)


def test_a_shape_may_be_of_numpy() -> None:
    def circuit(x: Any) -> None:
        qml.RX(x[1], 0)

    assert Program.from_pennylane(circuit, inputs=np.int64(2)).inputs == ("x0", "x1")  # type: ignore[arg-type]
