"""The trainable model: the policy it exports, its gradient, its size, and output reuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from qcompile.policy import Policy
from qcompile.rl.models import CircuitModel
from qcompile.rl.settings import Settings
from qcompile.simulate import Simulator

BASE = Settings(steps=1, theta_spread_rad=3.0)

VARIANTS = {
    "plain": BASE,
    "reuse": replace(BASE, reuse=5),
    "scaled": replace(BASE, scales=(0.7, 2.0, 8.0), trainable_scale=True),
    "serial": replace(BASE, layout="serial", scales=(1.0, 3.0), reuse=2),
    "single": replace(BASE, layout="single", scales=(1.0, 0.5), reuse=3),
}


def make(settings: Settings, features: int = 4, outputs: int = 3, seed: int = 0) -> CircuitModel:
    return CircuitModel(features, outputs, settings, torch.Generator().manual_seed(seed))


def perturb(model: CircuitModel) -> None:
    """Change every parameter from its initial value, reproducibly."""
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in model.parameters():
            parameter += 0.3 * torch.randn(parameter.shape, generator=generator)


def logits(policy: Policy, observations: np.ndarray) -> np.ndarray:
    z = Simulator(policy.program).expectation(policy.encode(observations), policy.theta)
    return policy.logits(z)


@pytest.mark.parametrize("name", VARIANTS)
def test_the_exported_policy_computes_the_same(name: str) -> None:
    model = make(VARIANTS[name])
    perturb(model)
    observations = np.random.default_rng(2).normal(size=(20, 4))
    ours = model(torch.tensor(observations, dtype=torch.float32)).detach().numpy()
    policy = model.policy("p", "e", {"note": 1})
    assert policy.reuse == 1
    assert policy.metadata == {"note": 1}
    np.testing.assert_allclose(ours, logits(policy, observations), rtol=2e-5, atol=2e-5)


@pytest.mark.parametrize("name", VARIANTS)
def test_copies_of_an_output_lie_side_by_side(name: str) -> None:
    """Column c * n + i of the layer is copy c of circuit i, as policy files have it."""
    settings = VARIANTS[name]
    model = make(settings)
    perturb(model)
    n, policy = len(model.program), model.policy("p", "e", {})
    weights = model.head.weights.detach().double().numpy()
    for circuit in range(n):
        copies = sum(weights[:, copy * n + circuit] for copy in range(settings.reuse))
        np.testing.assert_allclose(policy.weights[:, circuit], copies, rtol=1e-12)


@pytest.mark.parametrize("name", VARIANTS)
def test_the_gradient_is_that_of_finite_differences(name: str) -> None:
    """Central differences of the exported double-precision policy; error about step^2 = 1e-8."""
    model = make(VARIANTS[name])
    perturb(model)
    rng = np.random.default_rng(3)
    observations, mix = rng.normal(size=(6, 4)), rng.normal(size=(6, 3))

    def loss(policy: Policy) -> float:
        return float((logits(policy, observations) * mix).sum())

    output = model(torch.tensor(observations, dtype=torch.float32))
    (output * torch.tensor(mix, dtype=torch.float32)).sum().backward()
    policy, step = model.policy("p", "e", {}), 1e-4
    assert model.theta.grad is not None
    for index in range(len(policy.theta)):
        up, down = policy.theta.copy(), policy.theta.copy()
        up[index] += step
        down[index] -= step
        slope = (loss(replace(policy, theta=up)) - loss(replace(policy, theta=down))) / (2 * step)
        assert model.theta.grad[index].item() == pytest.approx(slope, rel=1e-3, abs=1e-3)
    if not model.log_scale.requires_grad:
        assert model.log_scale.grad is None
        return
    for index, scale in enumerate(policy.encoder.scale):
        moved = []
        for sign in (1, -1):
            scales = policy.encoder.scale.copy()
            scales[index] = scale * np.exp(sign * step)
            moved.append(loss(replace(policy, encoder=replace(policy.encoder, scale=scales))))
        slope = (moved[0] - moved[1]) / (2 * step)
        assert model.log_scale.grad is not None
        assert model.log_scale.grad[index].item() == pytest.approx(slope, rel=1e-3, abs=1e-3)


def test_scales_belong_to_copies() -> None:
    model = make(replace(BASE, scales=(0.5, 3.0)), features=3)
    encoder = model.policy("p", "e", {}).encoder
    np.testing.assert_array_equal(encoder.feature, [0, 1, 2, 0, 1, 2])
    np.testing.assert_allclose(encoder.scale, [0.5] * 3 + [3.0] * 3, rtol=1e-6)
    single = make(replace(BASE, layout="single", scales=(0.5, 3.0))).policy("p", "e", {}).encoder
    np.testing.assert_allclose(single.scale, [0.5] * 3 + [3.0] * 3, rtol=1e-6)


@pytest.mark.parametrize(
    ("features", "actions", "settings", "count"),
    [
        (4, 2, replace(BASE, reuse=16), 4 + 8 + 2),
        (6, 3, replace(BASE, reuse=8), 6 + 21),
        (8, 4, replace(BASE, reuse=8, scales=(1.0, 1.0, 1.0)), 24 + 100),
        (4, 2, replace(BASE, layout="single"), 1 + 4),
    ],
)
def test_a_deployed_policy_has_the_paper_s_parameters(
    features: int, actions: int, settings: Settings, count: int
) -> None:
    model = make(settings, features, actions)
    assert model.policy("p", "e", {}).parameter_count == count
    trained = sum(p.numel() for p in model.parameters() if p.requires_grad)
    circuits = len(model.program)
    theta = len(model.program.parameters)
    assert trained == theta + actions * (settings.reuse * circuits + 1)


@pytest.mark.parametrize("reuse", [2, 8, 32])
def test_reuse_multiplies_the_step_of_the_folded_weights(reuse: int) -> None:
    """l copies of a weight each take the step of one: their sum moves l times as far."""
    once, often = make(BASE), make(replace(BASE, reuse=reuse))
    with torch.no_grad():
        often.theta.copy_(once.theta)
        often.head.weights.copy_(once.head.weights.repeat(1, reuse) / reuse)
    observations = torch.randn(16, 4, generator=torch.Generator().manual_seed(4))
    torch.testing.assert_close(once(observations), often(observations), rtol=1e-4, atol=1e-5)
    moved = []
    for model in (once, often):
        before = model.policy("p", "e", {})
        optimiser = torch.optim.SGD(model.parameters(), lr=0.1)
        model(observations).square().sum().backward()
        optimiser.step()
        moved.append(model.policy("p", "e", {}).weights - before.weights)
    assert np.abs(moved[0]).max() > 0.1
    np.testing.assert_allclose(moved[1], reuse * moved[0], rtol=1e-3, atol=1e-4)


def test_the_same_generator_makes_the_same_model() -> None:
    first, again, other = (make(VARIANTS["scaled"], seed=s) for s in (5, 5, 6))
    assert torch.equal(first.head.weights, again.head.weights)
    assert torch.equal(first.theta, again.theta)
    assert not torch.equal(first.head.weights, other.head.weights)


def test_first_numbers_lie_in_their_ranges() -> None:
    """Glorot's limit is sqrt(6 / (inputs + outputs)); theta is uniform in a width about 0."""
    model = make(replace(BASE, reuse=16, theta_spread_rad=0.5), outputs=2)
    limit = np.sqrt(6 / (64 + 2))
    size = model.head.weights.abs().max().item()
    assert 0.9 * limit < size <= limit
    assert model.theta.abs().max().item() <= 0.25
    assert not make(replace(BASE, theta_spread_rad=0.0)).theta.any()
    narrow = make(replace(BASE, reuse=100, weight_spread=0.01)).head.weights
    # the deviation of 1200 normal draws has a relative error of 1/sqrt(2400): 2 %
    assert narrow.std().item() == pytest.approx(0.01, rel=0.1)
