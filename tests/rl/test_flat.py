"""All trained parameters of a model in one tensor: shared memory, and clipped gradients."""

from __future__ import annotations

import pytest
import torch

from qcompile.rl.flat import FlatParameters


def model() -> torch.nn.Module:
    """A layer of six weights, which are trained, and two biases, which are not."""
    made = torch.nn.Linear(3, 2)
    made.bias.requires_grad = False
    return made


def test_what_is_trained_shares_its_memory() -> None:
    made = model()
    flat = FlatParameters(made)
    assert flat.parameter.shape == (6,)
    with torch.no_grad():
        flat.parameter.copy_(torch.arange(6.0))
    assert made.weight.tolist() == [[0, 1, 2], [3, 4, 5]]
    made(torch.tensor([[1.0, 2.0, 3.0]]))[0, 1].backward()
    assert flat.parameter.grad is not None
    assert flat.parameter.grad.tolist() == [0, 0, 0, 1, 2, 3]
    flat.zero_gradient()
    assert made.weight.grad is not None
    assert made.weight.grad.abs().sum() == 0


@pytest.mark.parametrize(("most", "norm"), [(0.5, 0.5), (4.9, 4.9), (5.1, 5.0), (100.0, 5.0)])
def test_a_gradient_is_cut_to_the_norm_and_never_raised(most: float, norm: float) -> None:
    flat = FlatParameters(model())
    assert flat.parameter.grad is not None
    flat.parameter.grad[1], flat.parameter.grad[4] = 3.0, -4.0
    flat.clip_gradient(most)
    assert flat.parameter.grad.norm().item() == pytest.approx(norm, rel=1e-5)
    assert (flat.parameter.grad[1] / flat.parameter.grad[4]).item() == pytest.approx(-0.75)
