"""An update: the paper's objective, targets, step sizes and diagnostics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from scipy.special import softmax

from qcompile.policy import Policy
from qcompile.rl.models import make_model
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings
from qcompile.rl.training_log import Update

Outputs = Callable[[Policy, np.ndarray], np.ndarray]


def test_an_update_is_the_paper_s_objective(
    monkeypatch: pytest.MonkeyPatch, outputs: Outputs
) -> None:
    """Two epochs of one episode of the clock, the losses worked by hand.

    The optimiser is replaced: after the first loss the bias of the actor is moved by a chosen
    amount, so the ratios of the second epoch are known, some of them beyond the clip.
    """
    settings = Settings(episodes=1, epochs=2, gamma=0.9, clip=0.1, reuse=2, entropy=0.3)
    trainer = Trainer("Clock-v0", settings, 0)
    move = torch.tensor([0.5, -0.4, 0.1])
    losses: tuple[list[float], list[float]] = ([], [])

    def descend(actor_loss: torch.Tensor, critic_loss: torch.Tensor) -> None:
        losses[0].append(actor_loss.item())
        losses[1].append(critic_loss.item())
        with torch.no_grad():
            trainer.actor.head.bias += move

    monkeypatch.setattr(trainer._learner, "_descend", descend)
    chosen = iter([0, 2, 1])
    rollout = trainer._collector.collect(lambda seen: np.array([next(chosen)]), None)
    actor, critic = (m.policy("p", "e", {}) for m in (trainer.actor, trainer._critic))
    trainer._update(rollout)

    observations = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]])
    third = 10 + 3 + 0.5
    second = 10 + 2 + 1.0 + 0.9 * third
    returns = np.array([10 + 1 + 0.0 + 0.9 * second, second, third])
    values = outputs(critic, observations)[:, 0]
    raw = returns - values
    advantages = (raw - raw.mean()) / raw.std()

    def probabilities(bias: np.ndarray) -> np.ndarray:
        odds = np.exp(outputs(actor, observations) + bias)
        return odds / odds.sum(axis=1, keepdims=True)

    before, after = probabilities(np.zeros(3)), probabilities(move.numpy())
    rows, taken = np.arange(3), [0, 2, 1]
    for epoch, now in enumerate((before, after)):
        ratio = now[rows, taken] / before[rows, taken]
        gains = [
            min(r * a, min(max(r, 0.9), 1.1) * a) for r, a in zip(ratio, advantages, strict=True)
        ]
        entropy = -(now * np.log(now)).sum(axis=1).mean()
        expected = -np.mean(gains) - 0.3 * entropy
        assert losses[0][epoch] == pytest.approx(expected, abs=1e-4)
        assert losses[1][epoch] == pytest.approx(((values - returns) ** 2).mean(), rel=1e-5)
    assert (np.abs(ratio - 1) > 0.1).any(), "nothing is clipped"


def test_an_update_says_how_it_went(monkeypatch: pytest.MonkeyPatch, outputs: Outputs) -> None:
    """The record is that of the last minibatch, here of known ratios, worked in numpy."""
    settings = Settings(episodes=9, epochs=2, gamma=0.9, clip=0.1, entropy=0.3)
    trainer = Trainer("Clock-v0", settings, 0)
    assert trainer.last_update is None
    move = torch.tensor([0.5, -0.4, 0.02])

    def descend(actor_loss: torch.Tensor, critic_loss: torch.Tensor) -> None:
        with torch.no_grad():
            trainer.actor.head.bias += move

    monkeypatch.setattr(trainer._learner, "_descend", descend)
    chosen = iter([0, 2, 1])
    rollout = trainer._collector.collect(lambda seen: np.array([next(chosen)]), None)
    actor, critic = (m.policy("p", "e", {}) for m in (trainer.actor, trainer._critic))
    trainer._update(rollout)

    observations = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]])
    third = 10 + 3 + 0.5
    second = 10 + 2 + 1.0 + 0.9 * third
    raw = np.array([10 + 1 + 0.0 + 0.9 * second, second, third]) - outputs(critic, observations).T
    advantages = ((raw - raw.mean()) / raw.std())[0]
    logits = outputs(actor, observations)
    before, after = (softmax(logits + shift, axis=1) for shift in (0.0, move.numpy()))
    ratio = (after / before)[np.arange(3), [0, 2, 1]]
    outside = np.abs(ratio - 1) > 0.1
    assert outside.any()
    assert not outside.all()
    gain = np.minimum(ratio * advantages, np.clip(ratio, 0.9, 1.1) * advantages).mean()
    update = trainer.last_update
    assert update is not None
    assert (update.steps, update.episodes) == (3, 1)
    assert update.actor_loss == pytest.approx(-gain, abs=1e-5), "without the entropy bonus"
    assert update.critic_loss == pytest.approx((raw**2).mean(), rel=1e-5)
    assert update.entropy == pytest.approx(-(after * np.log(after)).sum(axis=1).mean(), rel=1e-5)
    assert update.divergence == pytest.approx((ratio - 1 - np.log(ratio)).mean(), rel=1e-4)
    assert update.clipped == pytest.approx(outside.mean())


def test_an_update_that_moves_nothing_has_no_divergence() -> None:
    """One epoch of one batch: the record is of ratios of 1, before the only step."""
    trainer = Trainer("Clock-v0", Settings(episodes=2, epochs=1), 0)
    seen: list[Update | None] = []
    trainer.train(on_update=lambda: seen.append(trainer.last_update))
    assert [(u.steps, u.episodes) for u in seen if u] == [(3, 1), (6, 2)]
    assert all((u.divergence, u.clipped) == (0.0, 0.0) for u in seen if u)


def test_step_sizes_fall_to_two_percent_where_annealed() -> None:
    """Ten updates: after the k-th episode (10 - k) / 10 of the run is left, 2 % at the end."""
    for anneal in (True, False):
        settings = Settings(episodes=10, anneal=anneal, actor_lr=0.003, critic_lr=0.05)
        trainer = Trainer("Match-v0", settings, 0)
        groups, rates = trainer._learner._optimiser.param_groups, np.zeros((0, 2))

        def note(groups: Any = groups) -> None:
            nonlocal rates
            rates = np.vstack([rates, [group["lr"] for group in groups]])

        trainer.train(on_update=note)
        left = [max(1 - k / 10, 0.02) if anneal else 1.0 for k in range(1, 11)]
        np.testing.assert_allclose(rates, np.outer(left, [0.003, 0.05]), rtol=1e-9)


@pytest.mark.parametrize("model", ["svqc", "mvqc", "surrogate", "fcn", "cnn"])
def test_a_step_is_torch_s_own_adam_on_each_parameter(model: str) -> None:
    """Flat and fused against Adam and clip_grad_norm_, parameter by parameter, in two models."""
    encoded = model in ("svqc", "mvqc", "surrogate")
    scales: dict[str, Any] = {"trainable_scale": True, "scales": (1.0, 2.0)} if encoded else {}
    settings = Settings(steps=64, gradient_norm=0.05).changed(model=model, **scales)
    trainer = Trainer("CartPole-v1", settings, 0)
    for group, rate in zip(trainer._learner._optimiser.param_groups, (0.01, 0.03), strict=True):
        group["lr"] = rate
    ours = (trainer.actor, trainer._critic)
    theirs = [make_model(settings, 4, n, torch.Generator()) for n in (2, 1)]
    for mine, other in zip(ours, theirs, strict=True):
        other.load_state_dict(mine.state_dict())
    adam = torch.optim.Adam(
        [
            {"params": list(module.parameters()), "lr": rate}
            for module, rate in zip(theirs, (0.01, 0.03), strict=True)
        ],
        eps=1e-5,
    )
    first = [p.detach().clone() for p in theirs[0].parameters()]
    generator = torch.Generator().manual_seed(0)
    for _ in range(5):
        seen = torch.randn(16, 4, generator=generator)
        losses = [[m(seen).square().mean() for m in pair] for pair in (ours, theirs)]
        trainer._learner._descend(*losses[0])
        adam.zero_grad()
        sum(losses[1]).backward()  # type: ignore[union-attr]
        for module in theirs:
            torch.nn.utils.clip_grad_norm_(module.parameters(), 0.05)
        adam.step()
    for mine, other in zip(ours, theirs, strict=True):
        for p, q in zip(mine.parameters(), other.parameters(), strict=True):
            assert q.grad is not None
            # Of a gradient that vanishes rounding is left, which Adam lifts to a part of a step.
            moved = q.grad.abs() > 1e-6
            torch.testing.assert_close(p[moved], q[moved], rtol=1e-4, atol=1e-6)
            assert moved.any()
    assert all((p - q).abs().max() > 1e-3 for p, q in zip(first, ours[0].parameters(), strict=True))


@pytest.mark.parametrize("bootstrap", [True, False])
def test_a_time_limit_is_bootstrapped_where_asked(bootstrap: bool, outputs: Outputs) -> None:
    """The second episode of the clock is truncated: the value of its last state counts, or 0."""
    settings = Settings(episodes=2, gamma=0.9, bootstrap_truncated=bootstrap)
    trainer = Trainer("Clock-v0", settings, 0)
    for _ in range(2):
        rollout = trainer._collector.collect(lambda seen: np.array([0]), None)
    _, targets = trainer._learner._advantages_and_targets(rollout, 1.0)
    critic = trainer._critic.policy("p", "e", {})
    behind = outputs(critic, np.array([[2.0, 3.0]]))[0, 0] if bootstrap else 0.0
    third = 23 + 0.9 * behind
    second = 22 + 0.9 * third
    expected = [21 + 0.9 * second, second, third]
    np.testing.assert_allclose(targets.numpy(), expected, rtol=1e-5)
