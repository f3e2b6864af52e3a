"""Gradients of circuits of several qubits against the parameter-shift rule, by Qiskit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from wide import ANY, SYMBOLS, operator, random_circuit

from qcompile.errors import CircuitError
from qcompile.ir import Circuit, Program
from qcompile.nn import CircuitLayer
from qcompile.states.statevector import Statevectors


def parities(circuit: Circuit, values: dict[str, float]) -> np.ndarray:
    """<Z> of every qubit, and of the product of all, by Qiskit."""
    p = np.abs(operator(circuit, values)[:, 0]) ** 2
    signs = 1 - 2 * (np.arange(len(p)) >> np.arange(circuit.width)[:, None] & 1)
    return np.array([*(signs @ p), signs.prod(axis=0) @ p])


def shifted(circuit: Circuit, values: dict[str, float]) -> np.ndarray:
    """The gradient by all symbols, (symbols, observables): a gate at a time, moved by pi/2.

    Source: arXiv 1811.11184. An angle's coefficient of a symbol is a factor of its derivative.
    """
    gradient = np.zeros((len(SYMBOLS), circuit.width + 1))
    angles = circuit.angles
    for index, angle in enumerate(angles):
        if angle.is_constant:
            continue
        moved = [
            parities(
                circuit.with_angles([*angles[:index], angle + by, *angles[index + 1 :]]), values
            )
            for by in (np.pi / 2, -np.pi / 2)
        ]
        for symbol, coefficient in angle.terms:
            gradient[SYMBOLS.index(symbol)] += coefficient * (moved[0] - moved[1]) / 2
    return gradient


@pytest.mark.parametrize(("seed", "width"), [*((s, 2 + s % 4) for s in range(8)), (8, 6), (9, 7)])
def test_it_is_that_of_the_parameter_shift_rule(seed: int, width: int) -> None:
    rng = np.random.default_rng(seed)
    circuit = random_circuit(rng, ANY, width)
    while len({symbol for angle in circuit.angles for symbol in angle.symbols}) < len(SYMBOLS):
        circuit = random_circuit(rng, ANY, width)
    program = replace(
        Program.of([circuit], 2, 2),
        observables=(*((q,) for q in range(width)), tuple(range(width))),
    )
    values = rng.uniform(-3, 3, (3, 4))
    values[:, 2:] = values[0, 2:]
    x = torch.tensor(values[:, :2], requires_grad=True)
    theta = torch.tensor(values[0, 2:], requires_grad=True)
    found = Statevectors(program, torch.float64)(x, theta)
    rows = [dict(zip(SYMBOLS, row, strict=True)) for row in values.tolist()]
    expected = np.array([shifted(circuit, row) for row in rows])
    for column in range(width + 1):
        by_x, by_theta = torch.autograd.grad(found[:, column].sum(), (x, theta), retain_graph=True)
        np.testing.assert_allclose(by_x, expected[:, :2, column], atol=1e-12)
        np.testing.assert_allclose(by_theta, expected[:, 2:, column].sum(axis=0), atol=1e-12)


def uploading(width: int, layers: int = 2) -> Program:
    """Inputs on every qubit, trained angles, a ring of cz."""
    gates: list[list[object]] = []
    for layer in range(layers):
        for qubit in range(width):
            gates += [["ry", f"x{qubit}", qubit], ["rx", f"theta{layer * width + qubit}", qubit]]
        gates += [["cz", qubit, (qubit + 1) % width] for qubit in range(width - (width == 2))]
    return Program.of([Circuit.of(gates, width)], width, layers * width)


@pytest.mark.parametrize("width", [2, 5, 9])
def test_single_precision_follows_double_precision(width: int) -> None:
    program = uploading(width, 4)
    generator = torch.Generator().manual_seed(0)
    x, theta = (torch.randn(shape, generator=generator) for shape in ((5, width), (4 * width,)))
    gradients = []
    for dtype in (torch.float32, torch.float64):
        leaves = [v.to(dtype).requires_grad_() for v in (x, theta)]
        gradients.append(torch.autograd.grad(Statevectors(program, dtype)(*leaves).sum(), leaves))
    for single, double in zip(*gradients, strict=True):
        assert single.dtype == torch.float32
        torch.testing.assert_close(single.double(), double, atol=2e-5, rtol=1e-5)


@pytest.mark.parametrize("width", [3, 6])
def test_an_empty_batch_has_a_zero_gradient(width: int) -> None:
    program = uploading(width)
    layer = CircuitLayer(program)
    x = torch.empty((0, width), requires_grad=True)
    found = layer(x)
    assert found.shape == (0, width)
    found.sum().backward()
    assert layer.theta.grad is not None
    assert not layer.theta.grad.any()
    assert x.grad is not None
    assert x.grad.shape == (0, width)


def test_a_batch_is_its_rows() -> None:
    program = uploading(4, 3)
    state = Statevectors(program, torch.float64)
    theta = torch.linspace(-2, 2, 12, dtype=torch.float64, requires_grad=True)
    x = torch.randn((6, 4), dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    (together,) = torch.autograd.grad(state(x, theta).sum(), theta)
    alone = [torch.autograd.grad(state(row[None], theta).sum(), theta)[0] for row in x]
    torch.testing.assert_close(together, torch.stack(alone).sum(dim=0))


@pytest.mark.parametrize("by_inputs", [True, False])
def test_a_second_derivative_is_refused(by_inputs: bool) -> None:
    layer = CircuitLayer(uploading(2))
    x = torch.rand((3, 2), requires_grad=by_inputs)
    (gradient,) = torch.autograd.grad(layer(x).sum(), layer.theta, create_graph=True)
    with pytest.raises(CircuitError, match="cannot be differentiated again"):
        (gradient.square().sum() + layer.theta.sum()).backward()


def test_angles_of_several_symbols_and_inputs() -> None:
    """<Z> of ry(2 x0 - x1 + theta0) is a cosine, through a cx and back."""
    angle = "2*x0-x1+theta0"
    circuit = Circuit.of([["ry", angle, 0], ["cx", 0, 1], ["cx", 0, 1], ["cx", 1, 0]], 2)
    x = torch.tensor([[0.3, -0.4], [1.0, 0.2]], dtype=torch.float64, requires_grad=True)
    theta = torch.tensor([0.5], dtype=torch.float64, requires_grad=True)
    found = Statevectors(Program.of([circuit], 2, 1), torch.float64)(x, theta)
    phase = (2 * x[:, 0] - x[:, 1] + theta).detach()
    torch.testing.assert_close(found[:, 0], phase.cos())
    by_x, by_theta = torch.autograd.grad(found[:, 0].sum(), (x, theta))
    torch.testing.assert_close(by_x, torch.stack([-2 * phase.sin(), phase.sin()], dim=1))
    torch.testing.assert_close(by_theta, -phase.sin().sum()[None])
