"""Ideal expectations against Qiskit's statevector, the paper's closed form, finite differences."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from qiskit import QuantumCircuit
from qiskit.quantum_info import Operator, Statevector

from qcompile.errors import CircuitError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Circuit, Program
from qcompile.native import RX, SX, NativeGates
from qcompile.passes import lower
from qcompile.simulate import LateAngles, Simulator

ANGLES = ("0.4", "pi", "-pi/2", "x0", "x1-theta0", "0.5*x0+2*theta1-pi/2", "theta1+1", "x0+x1")
GATES = [*FIXED_GATES, *(f"{name}({angle})" for name in ROTATION_GATES for angle in ANGLES)]
RNG = np.random.default_rng(11)
X, THETA = RNG.uniform(-4, 4, (3, 2)), RNG.uniform(-4, 4, 2)


def random_program(size: int, seed: int) -> Program:
    rng = np.random.default_rng(seed)
    texts = [" ".join(rng.choice(GATES, rng.integers(0, 13))) for _ in range(size)]
    return Program.of(map(Circuit.parse, texts), inputs=2, parameters=2)


def built(circuit: Circuit, x: np.ndarray, theta: np.ndarray) -> QuantumCircuit:
    values = {"x0": x[0], "x1": x[1], "theta0": theta[0], "theta1": theta[1]}
    made = QuantumCircuit(1)
    for gate in circuit.gates:
        if gate.angle is None:
            getattr(made, gate.name)(0)
        else:
            angle = gate.angle.constant + sum(c * values[s] for s, c in gate.angle.terms)
            getattr(made, gate.name)(angle, 0)
    return made


def reference(program: Program) -> np.ndarray:
    states = [[Statevector(built(c, x, THETA)) for c in program.circuits] for x in X]
    chances = np.array([[state.probabilities() for state in row] for row in states])
    return chances[..., 0] - chances[..., 1]


def test_expectations_equal_qiskit_s_statevector() -> None:
    program = random_program(150, seed=1)
    z = Simulator(program).expectation(X, THETA)
    assert z.shape == (3, 150)
    np.testing.assert_allclose(z, reference(program), rtol=0, atol=1e-13)


def test_the_closed_form_of_the_paper() -> None:
    program = Program.of([Circuit.parse("h ry(x0) rz(x0) ry(theta0)")], inputs=1, parameters=1)
    x = np.linspace(-np.pi / 2, np.pi / 2, 101)
    for theta in (0.0, 0.3, -1.7, np.pi):
        z = Simulator(program).expectation(x[:, None], np.array([theta]))[:, 0]
        closed = -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)
        np.testing.assert_allclose(z, closed, rtol=0, atol=1e-15)


@pytest.mark.parametrize("level", [1, 2])
@pytest.mark.parametrize("native", [SX, RX])
def test_programs_with_late_angles(level: int, native: NativeGates) -> None:
    program = random_program(40, seed=2)
    z = Simulator(lower(program, level, native)).expectation(X, THETA)
    np.testing.assert_allclose(z, reference(program), rtol=0, atol=1e-12)


def test_euler_angles_make_qiskit_s_operator() -> None:
    program = random_program(60, seed=3)
    first, polar, last = Simulator(program).euler(X, THETA)
    assert first.shape == polar.shape == last.shape == (3, 60)
    assert polar.min() >= 0
    assert polar.max() <= np.pi
    for row, x in enumerate(X):
        for column, circuit in enumerate(program.circuits):
            turned = QuantumCircuit(1)
            turned.rz(first[row, column], 0)
            turned.ry(polar[row, column], 0)
            turned.rz(last[row, column], 0)
            ours, theirs = Operator(turned).data, Operator(built(circuit, x, THETA)).data
            overlap = np.trace(ours.conj().T @ theirs)
            np.testing.assert_allclose(ours * overlap / abs(overlap), theirs, atol=1e-12)


def test_torch_and_numpy_agree() -> None:
    program = random_program(60, seed=4)
    ours = Simulator(program).expectation(X, THETA)
    simulator = Simulator(program, torch, torch.float64)
    theirs = simulator.expectation(torch.tensor(X), torch.tensor(THETA))
    assert theirs.dtype == torch.float64
    np.testing.assert_allclose(theirs.numpy(), ours, rtol=0, atol=1e-14)


def test_torch_single_precision() -> None:
    program = random_program(20, seed=5)
    simulator = Simulator(program, torch, torch.float32)
    z = simulator.expectation(
        torch.tensor(X, dtype=torch.float32), torch.tensor(THETA, dtype=torch.float32)
    )
    assert z.dtype == torch.float32
    np.testing.assert_allclose(z.numpy(), reference(program), rtol=0, atol=1e-5)


def test_the_gradient_equals_finite_differences() -> None:
    program = random_program(25, seed=6)
    weights = RNG.normal(size=(3, 25))
    simulator, step = Simulator(program), 1e-5

    def score(x: np.ndarray, theta: np.ndarray) -> float:
        return float((simulator.expectation(x, theta) * weights).sum())

    x, theta = torch.tensor(X, requires_grad=True), torch.tensor(THETA, requires_grad=True)
    z = Simulator(program, torch, torch.float64).expectation(x, theta)
    (z * torch.tensor(weights)).sum().backward()
    for index in range(2):
        shift = step * np.eye(2)[index]
        slope = (score(X, THETA + shift) - score(X, THETA - shift)) / (2 * step)
        assert theta.grad[index].item() == pytest.approx(slope, abs=1e-7)
        for row in range(3):
            moved = np.zeros_like(X)
            moved[row] = shift
            slope = (score(X + moved, THETA) - score(X - moved, THETA)) / (2 * step)
            assert x.grad[row, index].item() == pytest.approx(slope, abs=1e-7)


@pytest.mark.parametrize(
    "texts",
    [["x", "", "h"], ["ry(theta0)"], ["rz(x0)"], [""], ["ry(theta0) rz(theta1) ry(0.3)", "y"], []],
)
@pytest.mark.parametrize("xp", [np, torch])
def test_results_have_a_row_for_every_observation(texts: list[str], xp) -> None:
    program = Program.of(map(Circuit.parse, texts), inputs=2, parameters=2)
    dtype = xp.float64
    simulator = Simulator(program, xp, dtype)
    for batch in (1, 3):
        z = simulator.expectation(xp.asarray(X[:batch]), xp.asarray(THETA))
        assert tuple(z.shape) == (batch, len(texts))
        if texts:
            np.testing.assert_allclose(np.asarray(z), reference(program)[:batch], atol=1e-14)


def test_one_observation_is_its_row_of_the_batch() -> None:
    simulator = Simulator(random_program(30, seed=7))
    batch = simulator.expectation(X, THETA)
    for row in range(3):
        one = simulator.expectation(X[row : row + 1], THETA)
        np.testing.assert_allclose(one, batch[row : row + 1], rtol=0, atol=1e-15)


def test_no_observation_is_an_empty_answer() -> None:
    assert Simulator(random_program(5, seed=8)).expectation(X[:0], THETA).shape == (0, 5)


def test_late_angles_are_the_euler_angles_of_their_blocks() -> None:
    texts = ["h ry(x0) rz(x0) ry(theta0)", "sx rz(x1) sx s"]
    source = Program.of(map(Circuit.parse, texts), inputs=2, parameters=2)
    lowered = lower(source, 1, SX)
    values = LateAngles(lowered.late_angles, lowered.inputs, lowered.parameters)(X, THETA)
    blocks = tuple(dict.fromkeys(late.block for late in lowered.late_angles))
    euler = np.stack(Simulator(Program(blocks, source.inputs, source.parameters)).euler(X, THETA))
    for column, late in enumerate(lowered.late_angles):
        part = ("first", "polar", "last").index(late.part)
        expected = euler[part, :, blocks.index(late.block)]
        np.testing.assert_array_equal(values[:, column], expected)


def test_a_fused_program_is_for_numpy() -> None:
    source = Program.of([Circuit.parse("h ry(x0) rz(x0) ry(theta0)")], inputs=2, parameters=2)
    fused = lower(source, 1, SX)
    assert fused.late_angles
    with pytest.raises(CircuitError, match="only be evaluated with numpy"):
        Simulator(fused, torch, torch.float64)
    plain = lower(source, 0, SX)
    assert not plain.late_angles
    Simulator(plain, torch, torch.float64)
