"""Learning under a device's noise: the residuals against binomial laws, and where they go."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from qcompile.deploy.deployment import Deployment
from qcompile.device import load_device
from qcompile.rl.acting_noise import ActingNoise
from qcompile.rl.models import CircuitModel
from qcompile.rl.ppo import Trainer
from qcompile.rl.result import TrainingResult
from qcompile.rl.settings import Settings

SHOTS = 4000
BASE = Settings(steps=512, environments=4, horizon=32, shots=SHOTS, theta_spread_rad=3.0)
LIMA: dict[str, Any] = {"backend": "ibm_lima", "shots": 64, "mitigation": "readout"}


def noisy(settings: Settings) -> tuple[CircuitModel, ActingNoise]:
    actor = CircuitModel(4, 2, settings, torch.Generator().manual_seed(0))
    return actor, ActingNoise(actor, settings, np.random.SeedSequence(1))


def observed(count: int) -> torch.Tensor:
    return torch.randn(count, 4, generator=torch.Generator().manual_seed(2))


def closed_form(actor: CircuitModel, observations: torch.Tensor) -> np.ndarray:
    """<Z> = -sin(x) cos(theta) - cos(x)^2 sin(theta), x the arctan of a feature."""
    x, theta = np.arctan(observations.double().numpy()), actor.theta.detach().double().numpy()
    return -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)


def test_residuals_of_an_ideal_device_are_shot_noise() -> None:
    """Mean 0 and variance (1 - z^2) / shots: 1200 pulls, their mean within 5 / sqrt(1200).

    The mean of their squares is 1 within 5 sqrt(2 / 1200).
    """
    actor, noise = noisy(BASE)
    seen = observed(300)
    with torch.no_grad():
        noise.act(seen)
    residual, z = noise.take_residuals().numpy(), closed_form(actor, seen)
    pulls = residual / np.sqrt((1 - z**2) / SHOTS)
    assert abs(pulls.mean()) < 5 / np.sqrt(1200)
    assert (pulls**2).mean() == pytest.approx(1.0, abs=5 * np.sqrt(2 / 1200))
    assert np.abs(residual).max() < 6 / np.sqrt(SHOTS)


def test_residuals_without_shots_are_what_the_device_does() -> None:
    """The same circuits, deployed as a policy on the same device, less the closed form."""
    settings = BASE.changed(backend="ibm_lima", shots=None)
    actor, noise = noisy(settings)
    seen = observed(50)
    with torch.no_grad():
        noise.act(seen)
    deployed = Deployment(
        actor.policy("p", "e", {}), load_device("ibm_lima"), shots=None, mitigation="none"
    )
    expected = deployed.expectation(seen.double().numpy()) - closed_form(actor, seen)
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(noise.take_residuals().numpy(), expected, atol=2e-6)


def test_outputs_are_the_head_on_what_was_measured() -> None:
    actor, noise = noisy(BASE)
    seen = observed(30)
    with torch.no_grad():
        outputs = noise.act(seen).numpy()
    z = closed_form(actor, seen) + noise.take_residuals().numpy()
    weights, bias = actor.head.weights.detach().numpy(), actor.head.bias.detach().numpy()
    np.testing.assert_allclose(outputs, z @ weights.T + bias, atol=1e-5)


def test_gradients_flow_through_the_ideal_circuit() -> None:
    """The residual is a constant: d output / d theta is that of the closed form."""
    actor, noise = noisy(BASE)
    seen, mix = observed(10), torch.randn(10, 2, generator=torch.Generator().manual_seed(3))
    residual = 0.1 * torch.ones(10, 4)
    (noise.outputs(seen, residual) * mix).sum().backward()
    x, theta = np.arctan(seen.double().numpy()), actor.theta.detach().double().numpy()
    slope = np.sin(x) * np.sin(theta) - np.cos(x) ** 2 * np.cos(theta)
    expected = (slope * (mix.numpy() @ actor.head.weights.detach().numpy())).sum(axis=0)
    assert actor.theta.grad is not None
    np.testing.assert_allclose(actor.theta.grad.numpy(), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("changes", [{}, LIMA], ids=["ideal", "ibm_lima"])
def test_an_update_starts_from_what_the_actions_were_drawn_from(
    changes: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The outputs that chose are noted step by step; the update computes them again, row by row."""
    trainer = Trainer("CartPole-v1", BASE.changed(**changes, epochs=1), 0)
    assert trainer._noise is not None
    chosen: list[torch.Tensor] = []
    act = trainer._noise.act

    def note(observations: torch.Tensor) -> torch.Tensor:
        chosen.append(act(observations))
        return chosen[-1]

    monkeypatch.setattr(trainer._noise, "act", note)
    computed: list[torch.Tensor] = []
    outputs = trainer._noise.outputs

    def again(observations: torch.Tensor, residual: torch.Tensor) -> torch.Tensor:
        computed.append(outputs(observations, residual))
        return computed[-1]

    monkeypatch.setattr(trainer._noise, "outputs", again)
    rollout = trainer._collector.collect(trainer._act, 32)
    trainer._update(rollout)
    drawn_from = torch.log_softmax(torch.cat(chosen), dim=1)
    assert drawn_from.shape == (32 * 4, 2)
    for found in computed:
        torch.testing.assert_close(torch.log_softmax(found, dim=1), drawn_from)
    assert len(computed) == 2, "once for the old probabilities and once for the only epoch"
    with torch.no_grad():
        ideal = trainer.actor(torch.from_numpy(rollout.observations).flatten(0, 1))
    assert (ideal - torch.cat(chosen)).abs().max() > 1e-3, "there is noise"


def test_residuals_are_taken_exactly_once() -> None:
    trainer = Trainer("CartPole-v1", BASE, 0)
    assert trainer._noise is not None
    trainer._collector.collect(trainer._act, 5)
    first = trainer._noise.take_residuals()
    assert first.shape == (5 * 4, 4)
    with pytest.raises((RuntimeError, ValueError)):
        trainer._noise.take_residuals()
    trainer._collector.collect(trainer._act, 3)
    assert trainer._noise.take_residuals().shape == (3 * 4, 4)


@pytest.mark.parametrize("pause_at", [None, 0.0, 11.0])
def test_residuals_are_taken_in_every_update_or_pause(pause_at: float | None) -> None:
    """A pause learns nothing, but what it did not learn from must not reach the next update."""
    settings = Settings(episodes=12, shots=16, pause_at=pause_at)
    trainer = Trainer("Match-v0", settings, 0)
    left: list[int] = []
    assert trainer._noise is not None
    noise = trainer._noise
    result = trainer.train(on_update=lambda: left.append(len(noise._residuals)))
    assert not result.interrupted
    assert left == [0] * 12


def numbers(result: TrainingResult) -> list[bytes]:
    return [tensor.numpy().tobytes() for tensor in result.actor.state_dict().values()]


def test_training_under_noise_repeats_with_its_seed() -> None:
    settings = BASE.changed(**LIMA, minibatch=64)
    first, again, other = (Trainer("CartPole-v1", settings, seed).train() for seed in (3, 3, 4))
    assert numbers(first) == numbers(again)
    assert first.episodes == again.episodes
    assert numbers(first) != numbers(other)
    quiet = settings.changed(backend="ideal", shots=None, mitigation="none")
    assert numbers(Trainer("CartPole-v1", quiet, 3).train()) != numbers(first)


def test_a_task_is_learned_under_noise() -> None:
    """As in test_ppo, but 64 shots on ibm_lima; chance is 10 of 20."""
    settings = Settings(
        environments=4,
        horizon=64,
        steps=5000,
        actor_lr=0.05,
        critic_lr=0.05,
        theta_spread_rad=1.0,
        weight_spread=0.01,
        minibatch=64,
        clip=0.2,
        backend="ibm_lima",
        shots=64,
    )
    rewards = [episode.reward for episode in Trainer("Match-v0", settings, 0).train().episodes]
    assert np.mean(rewards[:10]) < 15
    assert np.mean(rewards[-10:]) > 17


def test_without_noise_nothing_is_measured() -> None:
    assert Trainer("Match-v0", BASE.changed(shots=None), 0)._noise is None
    assert Trainer("Match-v0", BASE.changed(shots=None, backend="ibm_lima"), 0)._noise is not None
