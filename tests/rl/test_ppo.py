"""Training: trivial tasks are learned, runs repeat, and the paper's algorithms are the paper's."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from scipy.special import softmax

from qcompile.errors import EnvironmentMismatchError, TrainingError
from qcompile.policy import Policy
from qcompile.rl.models import make_model
from qcompile.rl.pause import Pause
from qcompile.rl.ppo import Trainer, TrainingResult, Update
from qcompile.rl.presets import settings_for
from qcompile.rl.rollout import FinishedEpisode
from qcompile.rl.settings import Settings
from qcompile.simulate import Simulator

QUICK = Settings(
    environments=4,
    horizon=64,
    steps=8000,
    actor_lr=0.05,
    critic_lr=0.05,
    theta_spread_rad=1.0,
    weight_spread=0.01,
    minibatch=64,
    clip=0.2,
)


def outputs(policy: Policy, observations: np.ndarray) -> np.ndarray:
    z = Simulator(policy.program).expectation(policy.encode(observations), policy.theta)
    return policy.logits(z)


def numbers(result: TrainingResult) -> list[bytes]:
    policy = result.policy
    arrays = (policy.theta, policy.weights, policy.bias, policy.encoder.scale)
    return [array.tobytes() for array in arrays]


@pytest.mark.parametrize("seed", [0, 1])
def test_a_trivial_task_is_learned(seed: int) -> None:
    """20 steps that pay 1 for the named action: chance is 10 of 20, nine in ten are asked for."""
    result = Trainer("Match-v0", QUICK, seed).train()
    logits = outputs(result.policy, np.array([[-1.0], [1.0]]))
    odds = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)
    assert odds[0, 0] > 0.9
    assert odds[1, 1] > 0.9
    rewards = [episode.reward for episode in result.episodes]
    assert np.mean(rewards[:10]) < 15
    assert np.mean(rewards[-10:]) > 18


def test_the_same_seed_trains_the_same_policy() -> None:
    settings = replace(QUICK, steps=800, trainable_scale=True, scales=(1.0, 3.0), entropy=0.01)
    first, again, other = (Trainer("Match-v0", settings, seed).train() for seed in (3, 3, 4))
    assert numbers(first) == numbers(again)
    assert first.episodes == again.episodes
    assert numbers(first) != numbers(other)


def test_a_budget_of_steps_or_episodes_is_kept() -> None:
    by_steps = Trainer("Match-v0", replace(QUICK, steps=513), 0).train()
    assert by_steps.steps == 768, "whole rollouts of 4 * 64 steps"
    paper = replace(settings_for("paper", "Match-v0"), episodes=3)
    by_episodes = Trainer("Match-v0", paper, 0).train()
    assert [e.episode for e in by_episodes.episodes] == [1, 2, 3]
    assert [e.steps for e in by_episodes.episodes] == [20, 40, 60]
    both = Trainer("Match-v0", replace(paper, steps=21), 0).train()
    assert len(both.episodes) == 2, "the first budget spent ends the run"


def test_cartpole_improves_clearly_over_chance() -> None:
    """Random play lasts 22 steps (deviation 12): a mean of 20 episodes above 100 is no chance."""
    settings = replace(settings_for("tuned", "CartPole-v1"), steps=30_000)
    result = Trainer("CartPole-v1", settings, 0).train()
    rewards = [episode.reward for episode in result.episodes]
    assert np.mean(rewards[:20]) < 60
    assert np.mean(rewards[-20:]) > 100
    assert result.policy.environment == "CartPole-v1"
    assert result.policy.name == "cartpole"
    assert result.policy.metadata["steps"] == result.steps


def test_the_paper_preset_runs() -> None:
    settings = replace(settings_for("paper", "CartPole-v1"), episodes=8)
    result = Trainer("CartPole-v1", settings, 0).train()
    assert len(result.episodes) == 8
    assert not result.interrupted
    assert result.policy.parameter_count == 4 + 8 + 2
    assert result.policy.reuse == 1
    assert result.policy.theta.any(), "theta starts at 0 and is trained"


@pytest.mark.parametrize(
    ("environment", "layout", "actor_lr", "critic_lr", "gamma", "reuse", "circuits", "pause_at"),
    [
        ("CartPole-v1", "parallel", 0.001, 0.01, 0.99, 16, 1, None),
        ("CartPole-v1", "single", 0.004, 0.04, 0.99, 1, 1, None),
        ("Acrobot-v1", "parallel", 0.004, 0.04, 0.98, 8, 1, None),
        ("LunarLander-v3", "parallel", 0.002, 0.02, 0.98, 8, 3, 200.0),
    ],
)
def test_the_paper_preset_is_the_paper_s_table(
    environment: str,
    layout: str,
    actor_lr: float,
    critic_lr: float,
    gamma: float,
    reuse: int,
    circuits: int,
    pause_at: float | None,
) -> None:
    settings = settings_for("paper", environment, "svqc", layout)
    assert (settings.actor_lr, settings.critic_lr) == (actor_lr, critic_lr)
    assert (settings.gamma, settings.epochs, settings.clip) == (gamma, 4, 0.1)
    assert (settings.reuse, settings.scales) == (reuse, (1.0,) * circuits)
    assert settings.pause_at == pause_at
    # Algorithm 1: a whole episode at a time, discounted returns, nothing else
    assert (settings.environments, settings.horizon, settings.minibatch) == (1, None, None)
    assert (settings.gae_lambda, settings.entropy, settings.gradient_norm) == (1.0, 0.0, None)
    extras = (settings.anneal, settings.scale_rewards, settings.bootstrap_truncated)
    assert extras == (False, False, False)
    assert (settings.theta_spread_rad, settings.trainable_scale) == (0.0, False)


def test_an_update_is_the_paper_s_objective(monkeypatch: pytest.MonkeyPatch) -> None:
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

    monkeypatch.setattr(trainer, "_descend", descend)
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


def test_an_update_says_how_it_went(monkeypatch: pytest.MonkeyPatch) -> None:
    """The record is that of the last minibatch, here of known ratios, worked in numpy."""
    settings = Settings(episodes=9, epochs=2, gamma=0.9, clip=0.1, entropy=0.3)
    trainer = Trainer("Clock-v0", settings, 0)
    assert trainer.last_update is None
    move = torch.tensor([0.5, -0.4, 0.02])

    def descend(actor_loss: torch.Tensor, critic_loss: torch.Tensor) -> None:
        with torch.no_grad():
            trainer.actor.head.bias += move

    monkeypatch.setattr(trainer, "_descend", descend)
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
        groups, rates = trainer._optimiser.param_groups, np.zeros((0, 2))

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
    for group, rate in zip(trainer._optimiser.param_groups, (0.01, 0.03), strict=True):
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
        trainer._descend(*losses[0])
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


def test_a_critic_can_be_a_network_beside_circuits() -> None:
    """Weights and biases: 4 to 8, 8 to 6, 6 to 1; tanh between; the policy is circuits still."""
    settings = settings_for("paper", "CartPole-v1").changed(critic_hidden=(8, 6), episodes=3)
    trainer = Trainer("CartPole-v1", settings, 0)
    first = [p.detach().clone() for p in trainer._critic.parameters()]
    assert [tuple(p.shape) for p in first] == [(8, 4), (8,), (6, 8), (6,), (1, 6), (1,)]
    assert first[4].abs().max() < 0.06, "first values are near 0: a deviation of 0.01"
    assert (first[5] == 0).all()
    seen = torch.randn(7, 4, generator=torch.Generator().manual_seed(0))
    value = seen.numpy()
    for weight, bias in ((first[0], first[1]), (first[2], first[3])):
        value = np.tanh(value @ weight.numpy().T + bias.numpy())
    value = value @ first[4].numpy().T + first[5].numpy()
    np.testing.assert_allclose(trainer._critic(seen).detach().numpy(), value, rtol=1e-5, atol=1e-6)
    result = trainer.train()
    assert all((p != q).any() for p, q in zip(first, trainer._critic.parameters(), strict=True))
    assert result.policy is not None
    assert trainer.parameter_count == 4 + 2 * 4 + 2


def test_input_scales_that_are_not_trained_stay() -> None:
    settings = QUICK.changed(steps=512, scales=(0.7, 2.0))
    trained = Trainer("Match-v0", settings, 0).train()
    np.testing.assert_allclose(trained.policy.encoder.scale, [0.7, 2.0], rtol=1e-6)
    moved = Trainer("Match-v0", settings.changed(trainable_scale=True), 0).train()
    assert (np.abs(moved.policy.encoder.scale - [0.7, 2.0]) > 1e-3).all()


@pytest.mark.parametrize("model", ["svqc", "mvqc", "surrogate", "fcn", "cnn"])
def test_every_model_learns_a_trivial_task(model: str) -> None:
    """As above, by playing: only circuits of one qubit can be deployed."""
    changes: dict[str, Any] = {} if model in ("svqc", "mvqc") else {"theta_spread_rad": 0.0}
    changes |= {"hidden": (8,)} if model in ("fcn", "cnn") else {}
    result = Trainer("Match-v0", QUICK.changed(model=model, **changes, actor_lr=0.03), 0).train()
    rewards = [episode.reward for episode in result.episodes]
    assert np.mean(rewards[:10]) < 15
    assert np.mean(rewards[-10:]) > 18
    assert (result.policy is None) == (model not in ("svqc", "surrogate"))
    if result.policy is not None:
        logits = outputs(result.policy, np.array([[-1.0], [1.0]]))
        assert logits.argmax(axis=1).tolist() == [0, 1]


@pytest.mark.parametrize("bootstrap", [True, False])
def test_a_time_limit_is_bootstrapped_where_asked(bootstrap: bool) -> None:
    """The second episode of the clock is truncated: the value of its last state counts, or 0."""
    settings = Settings(episodes=2, gamma=0.9, bootstrap_truncated=bootstrap)
    trainer = Trainer("Clock-v0", settings, 0)
    for _ in range(2):
        rollout = trainer._collector.collect(lambda seen: np.array([0]), None)
    _, targets = trainer._judge(rollout)
    critic = trainer._critic.policy("p", "e", {})
    behind = outputs(critic, np.array([[2.0, 3.0]]))[0, 0] if bootstrap else 0.0
    third = 23 + 0.9 * behind
    second = 22 + 0.9 * third
    expected = [21 + 0.9 * second, second, third]
    np.testing.assert_allclose(targets.numpy(), expected, rtol=1e-5)


class Actor:
    """Stands for an actor: its state remembers when it was saved."""

    episode = 0

    def state_dict(self) -> dict[str, int]:
        return {"episode": self.episode}


def scripted(pause: Pause, rewards: list[float]) -> tuple[list[bool], list[int | None]]:
    """What Algorithm 2 does after each of these episodes, and which episode's policy it keeps."""
    actor, held, kept = Actor(), [], []
    for number, reward in enumerate(rewards, 1):
        actor.episode = number
        finished = [FinishedEpisode(number, number, reward)]
        held.append(pause.holds(finished, actor))  # type: ignore[arg-type]
        kept.append(pause.best["episode"] if pause.best else None)  # type: ignore[arg-type]
    return held, kept


def test_algorithm_2_holds_good_episodes_and_keeps_the_longest_row() -> None:
    """Rewards, and the running average after each, against the threshold 200:

    250 (250) holds and is kept; 100 (175) updates and ends the row; 300 (216.7), 210 (215) and
    150 (202) hold, as the average is good, and 210 is a row of two; 220 (205) is a row of three;
    0 (175.7) updates; 200 (178.8) is good but begins a new row.
    """
    held, kept = scripted(Pause(200.0), [250, 100, 300, 210, 150, 220, 0, 200])
    assert held == [True, False, True, True, True, True, False, True]
    assert kept == [1, 1, 1, 4, 4, 6, 6, 6]


def test_algorithm_2_without_a_threshold_never_holds() -> None:
    held, kept = scripted(Pause(None), [1e6, -1e6, 1e6])
    assert held == [False] * 3
    assert kept == [None] * 3


def test_algorithm_2_forgets_after_twenty_episodes() -> None:
    """One disaster of -5000, then 210 each time: the row grows once the disaster is forgotten.

    Until then the average is below 200 and every good episode begins a new row of one.
    """
    held, kept = scripted(Pause(200.0), [-5000.0, *[210.0] * 25])
    assert held == [False, *[True] * 25]
    # Episode 21 is the first whose last twenty hold no disaster, its row is 1 like that of
    # episode 2, kept long before; 22 makes a row of two, and so on.
    assert kept == [None, *[2] * 20, 22, 23, 24, 25, 26]


def test_algorithm_2_stops_updates_in_training() -> None:
    """Episodes of the clock pay 36 or more: with a threshold of 30 nothing is ever learned."""
    settings = Settings(episodes=3, pause_at=30.0)
    result = Trainer("Clock-v0", settings, 0).train()
    assert not result.policy.theta.any()
    moved = Trainer("Clock-v0", replace(settings, pause_at=None), 0).train()
    assert moved.policy.theta.any()


def test_algorithm_2_returns_the_policy_it_saved() -> None:
    """Every policy that played is noted; the one returned is that of the longest row's end."""
    settings = Settings(episodes=60, actor_lr=0.05, critic_lr=0.05, pause_at=14.0)
    trainer = Trainer("Match-v0", settings, 0)
    played: list[list[float]] = []
    result = trainer.train(lambda episode, progress: played.append(trainer.actor.theta.tolist()))
    _, kept = scripted(Pause(14.0), [episode.reward for episode in result.episodes])
    saved = kept[-1]
    assert saved is not None
    assert played[saved - 1] != played[0]
    assert result.policy.theta.tolist() == played[saved - 1]


def test_ctrl_c_keeps_what_was_learned() -> None:
    seen: list[FinishedEpisode] = []

    def note(episode: FinishedEpisode, progress: float) -> None:
        assert 0 < progress <= 1
        seen.append(episode)
        if len(seen) == 3:
            raise KeyboardInterrupt

    threads = torch.get_num_threads()
    settings = replace(settings_for("paper", "Match-v0"), episodes=100)
    result = Trainer("Match-v0", settings, 0).train(note)
    assert result.interrupted
    assert result.episodes == seen
    assert len(seen) == 3
    whole = Trainer("Match-v0", replace(settings, episodes=2), 0).train()
    assert numbers(result) == numbers(whole), "two episodes were learned from, the third was not"
    assert torch.get_num_threads() == threads


def test_a_trainer_checks_what_it_is_given() -> None:
    with pytest.raises(TrainingError, match="4 environments without a horizon"):
        Trainer("Match-v0", Settings(environments=4, steps=1), 0)
    with pytest.raises(EnvironmentMismatchError, match="Unknown environment 'CartPoll-v1'"):
        Trainer("CartPoll-v1", QUICK, 0)
