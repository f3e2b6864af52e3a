"""The classical surrogate: its function, the policy it exports, and its equivalents."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from qcompile.policy import Policy, load_policy, save_policy
from qcompile.rl.models import CircuitModel, SurrogateModel
from qcompile.rl.settings import Settings
from qcompile.simulate import Simulator

BASE = Settings(model="surrogate", steps=1)
VARIANTS = {
    "plain": BASE,
    "reuse": replace(BASE, reuse=5),
    "scaled": replace(BASE, scales=(0.7, 2.0, 8.0), trainable_scale=True, reuse=2),
    "each": replace(BASE, scales=((0.7, 1.0, 2.0, 3.0), 5.0)),
}


def make(settings: Settings, features: int = 4, outputs: int = 3, seed: int = 0) -> SurrogateModel:
    model = SurrogateModel(features, outputs, settings, torch.Generator().manual_seed(seed))
    perturb(model)
    return model


def perturb(model: torch.nn.Module) -> None:
    """Change every parameter from its initial value, reproducibly."""
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in model.parameters():
            parameter += 0.3 * torch.randn(parameter.shape, generator=generator)


def logits(policy: Policy, observations: np.ndarray) -> np.ndarray:
    z = Simulator(policy.program).expectation(policy.encode(observations), policy.theta)
    return policy.logits(z)


@pytest.mark.parametrize("name", VARIANTS)
def test_outputs_are_the_formula_worked_in_numpy(name: str) -> None:
    """y = b + sum over copies c and features f of V sin(x_cf) + W cos(x_cf)^2, x = arctan(s u)."""
    model, settings = make(VARIANTS[name]), VARIANTS[name]
    observations = np.random.default_rng(2).normal(size=(20, 4))
    copies = len(settings.scales)
    scale = np.exp(model.log_scale.detach().double().numpy()).reshape(copies, 4)
    weights = model.head.weights.detach().double().numpy()
    weights = weights.reshape(3, settings.reuse, 2, copies, 4)
    expected = np.tile(model.head.bias.detach().double().numpy(), (20, 1))
    for c in range(copies):
        for f in range(4):
            x = np.arctan(scale[c, f] * observations[:, f])
            for r in range(settings.reuse):
                expected += np.outer(np.sin(x), weights[:, r, 0, c, f])
                expected += np.outer(np.cos(x) ** 2, weights[:, r, 1, c, f])
    found = model(torch.tensor(observations, dtype=torch.float32)).detach().numpy()
    np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-5)


@pytest.mark.parametrize("name", VARIANTS)
def test_the_exported_circuits_compute_the_same(name: str, tmp_path: Path) -> None:
    model = make(VARIANTS[name])
    policy = model.policy("p", "e", {"note": 1})
    assert (policy.reuse, policy.metadata) == (1, {"note": 1})
    observations = np.random.default_rng(3).normal(size=(20, 4))
    found = model(torch.tensor(observations, dtype=torch.float32)).detach().numpy()
    np.testing.assert_allclose(found, logits(policy, observations), rtol=2e-5, atol=2e-5)
    save_policy(policy, tmp_path / "p.json")
    again = load_policy(tmp_path / "p.json")
    np.testing.assert_allclose(
        logits(again, observations), logits(policy, observations), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("reuse", [1, 3])
def test_a_surrogate_can_be_any_policy_of_the_parallel_layout(reuse: int) -> None:
    """<Z> is -sin(x) cos(theta) - cos(x)^2 sin(theta): weights -cos(theta) W | -sin(theta) W."""
    settings = Settings(steps=1, scales=(0.7, 3.0), reuse=reuse, theta_spread_rad=6.0)
    circuits = CircuitModel(4, 3, settings, torch.Generator().manual_seed(0))
    perturb(circuits)
    changed = settings.changed(model="surrogate", theta_spread_rad=0.0)
    surrogate = SurrogateModel(4, 3, changed, torch.Generator().manual_seed(9))
    theta = circuits.theta.detach().numpy().astype(float)
    given = circuits.head.weights.detach().numpy().astype(float).reshape(3, reuse, 8)
    weights = np.concatenate([-np.cos(theta) * given, -np.sin(theta) * given], axis=2)
    with torch.no_grad():
        surrogate.head.weights.copy_(torch.from_numpy(weights.reshape(3, -1)))
        surrogate.head.bias.copy_(circuits.head.bias)
        surrogate.log_scale.copy_(circuits.log_scale)
    observations = 2 * torch.randn(200, 4, generator=torch.Generator().manual_seed(4))
    torch.testing.assert_close(surrogate(observations), circuits(observations), rtol=0, atol=2e-5)
    exact = [logits(m.policy("p", "e", {}), observations.numpy()) for m in (circuits, surrogate)]
    # Weights were rounded to single precision: 6e-8 of each, of which there are 16.
    np.testing.assert_allclose(exact[1], exact[0], atol=2e-6)


@pytest.mark.parametrize(
    ("features", "outputs", "changes", "count"),
    [
        (4, 2, {"reuse": 16}, 2 * (16 * 8 + 1)),
        (8, 4, {"scales": (1.0, 1.0, 1.0), "reuse": 8}, 4 * (8 * 48 + 1)),
        (4, 2, {"scales": (0.7, 2.0, 8.0), "trainable_scale": True}, 12 + 2 * (24 + 1)),
    ],
)
def test_parameters_are_counted_by_hand(
    features: int, outputs: int, changes: dict[str, object], count: int
) -> None:
    settings = replace(BASE, **changes)  # type: ignore[arg-type]
    trained = [p for p in make(settings, features, outputs).parameters() if p.requires_grad]
    assert sum(p.numel() for p in trained) == count
