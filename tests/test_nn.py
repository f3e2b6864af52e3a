"""Circuit layers within torch networks."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import torch

from qcompile.errors import CircuitError
from qcompile.ir import Circuit, Program
from qcompile.nn import CircuitLayer

GATES = [["ry", "x0", 0], ["ry", "theta0", 1], ["cz", 0, 1], ["ry", "theta1", 0], ["rx", "x1", 1]]


def program() -> Program:
    return Program.of([Circuit.of(GATES, 2), Circuit.parse("ry(x0+theta1)")], 2, 2)


def test_it_trains_within_a_network() -> None:
    """A circuit learns the outputs of another one with the same gates, from angles nearby."""
    torch.manual_seed(1)
    teacher = CircuitLayer(program())
    student = CircuitLayer(program(), teacher.theta + 0.5)
    x = torch.rand(64, 2)
    wanted = teacher(x).detach()
    optimizer = torch.optim.Adam(student.parameters(), lr=0.1)
    for _ in range(200):
        optimizer.zero_grad()
        loss = ((student(x) - wanted) ** 2).mean()
        loss.backward()
        optimizer.step()
    assert loss.item() < 1e-4


def test_a_row_is_the_closed_form() -> None:
    """ry(a) on one qubit gives <Z> = cos(a)."""
    layer = CircuitLayer(program(), torch.tensor([0.0, 0.5], dtype=torch.float64))
    x = torch.tensor([[0.2, 0.0], [1.0, 0.0]], dtype=torch.float64)
    np.testing.assert_allclose(layer(x)[:, 2].detach(), np.cos([0.7, 1.5]), atol=1e-12)


def test_its_state_is_that_of_a_module() -> None:
    layer = CircuitLayer(program())
    assert [*layer.state_dict()] == ["theta"]
    other = CircuitLayer(program())
    other.load_state_dict(layer.state_dict())
    x = torch.rand(3, 4, 2)
    torch.testing.assert_close(other(x), layer(x))
    assert layer(x).shape == (3, 4, 3)
    assert layer(x).dtype == torch.float32
    double = pickle.loads(pickle.dumps(copy.deepcopy(layer))).double()
    assert double(x).dtype == torch.float64
    torch.testing.assert_close(double(x).float(), layer(x))


def test_a_program_without_inputs_is_a_layer_too() -> None:
    layer = CircuitLayer(Program.of([Circuit.parse("ry(theta0)")], 0, 1), torch.tensor([0.3]))
    torch.testing.assert_close(
        layer(torch.empty(5, 0))[:, 0], torch.full((5,), np.cos(0.3)).float()
    )


def test_wrong_shapes_and_types_are_refused() -> None:
    with pytest.raises(CircuitError, match=r"x has shape \(4, 3\).\n.*the 2 inputs"):
        CircuitLayer(program())(torch.rand(4, 3))
    with pytest.raises(CircuitError, match=r"theta has shape \(3,\).\n.*\(2,\)"):
        CircuitLayer(program(), torch.zeros(3))
    with pytest.raises(CircuitError, match="takes a Program, found"):
        CircuitLayer("h ry(x0)")  # type: ignore[arg-type]
