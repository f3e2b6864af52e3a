"""Observation normalisation: values by hand, and a policy with the training's statistics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from qcompile.errors import TrainingError
from qcompile.policy import Ansatz, Network, Policy, load_policy
from qcompile.rl.checkpoint import load_checkpoint, save_checkpoint
from qcompile.rl.normalise import Normaliser
from qcompile.rl.ppo import Trainer
from qcompile.rl.presets import settings_for
from qcompile.rl.score import score
from qcompile.rl.settings import Settings

PAPER = settings_for("paper", "CartPole-v1").changed(normalise=True, episodes=8)
STEPPED = PAPER.changed(environments=4, horizon=32, minibatch=50, steps=640, episodes=None)


def test_mean_and_std_are_those_of_all_observations() -> None:
    """Two batches, counted one after the other, against numpy on both together."""
    rng = np.random.default_rng(1)
    batches = [rng.normal([5, -300], [0.1, 40], (steps, 3, 2)) for steps in (7, 50)]
    normaliser = Normaliser(torch.nn.Linear(2, 1), 2)
    seen = torch.tensor([[1.0, 2.0]])
    assert torch.equal(normaliser(seen), seen.double())  # nothing is known before the first rollout
    for batch in batches:
        normaliser.add(batch)
    every = np.concatenate([batch.reshape(-1, 2) for batch in batches])
    expected = (seen.numpy() - every.mean(axis=0)) / every.std(axis=0)
    np.testing.assert_allclose(normaliser(seen).numpy(), expected, rtol=1e-12)


def test_a_constant_feature_is_centred_and_not_stretched() -> None:
    normaliser = Normaliser(torch.nn.Linear(3, 1), 3)
    for _ in range(3):
        normaliser.add(np.full((40, 2, 3), [0.1, 123456.7, 0.0], np.float32))
    seen = normaliser(torch.tensor([[0.1, 123456.7, 2.0]])).numpy()
    np.testing.assert_allclose(seen, [[0.0, 0.0, 2.0]], atol=1e-9)


def test_the_actor_keeps_the_numbers_that_it_learned_with() -> None:
    """The statistics of a rollout are stored in the actor once that rollout is collected."""
    actor = torch.nn.Linear(1, 1)
    normaliser = Normaliser(actor, 1)
    normaliser.add(np.array([[[1.0]], [[5.0]]]))
    assert [array.tolist() for array in normaliser.statistics] == [[0.0], [1.0]]
    normaliser.store_statistics()
    assert [array.tolist() for array in normaliser.statistics] == [[3.0], [2.0]]
    assert actor.state_dict()["observation_mean"].tolist() == [3.0]


@pytest.mark.parametrize("settings", [PAPER, STEPPED, PAPER.changed(model="surrogate")])
def test_the_policy_has_the_logits_of_the_trained_model(settings: Settings) -> None:
    trainer = Trainer("CartPole-v1", settings, 2)
    policy = trainer.train().policy
    assert policy is not None
    mean, std = policy.encoder.mean, policy.encoder.std
    assert mean is not None
    assert std is not None
    assert ((std > 0.01) & (std < 2)).all()
    observations = np.random.default_rng(0).normal(0, 0.3, (50, 4)).astype(np.float32)
    with torch.no_grad():
        seen = torch.from_numpy((observations - mean) / std)
        expected = trainer.actor(seen).numpy()
    ideal = _ideal_logits(policy, observations.astype(float))
    np.testing.assert_allclose(ideal, expected, atol=1e-5)
    without = Trainer("CartPole-v1", settings.changed(normalise=False), 2).train().policy
    assert without is not None
    assert without.encoder.mean is None
    assert not np.array_equal(without.weights, policy.weights)


def _ideal_logits(policy: Any, observations: Any) -> Any:
    from qcompile.simulate import Simulator

    z = Simulator(policy.program, np).expectation(policy.encode(observations), policy.theta)
    return z @ policy.weights.T + policy.bias


@pytest.mark.parametrize(
    "settings",
    [
        PAPER,
        STEPPED,
        PAPER.changed(backend="ibm_lima", shots=64, mitigation="readout"),
        PAPER.changed(model="mvqc"),
        STEPPED.changed(pause_at=20.0),
    ],
)
def test_a_resumed_training_is_an_undisturbed_one_bit_for_bit(
    settings: Settings, tmp_path: Path
) -> None:
    whole, first = (Trainer("CartPole-v1", settings, 3) for _ in range(2))
    whole.train()
    path, updates = tmp_path / "state", 0

    def stop() -> None:
        nonlocal updates
        updates += 1
        if updates == 2:
            save_checkpoint(first, path)
            raise KeyboardInterrupt

    first.train(on_update=stop)
    resumed, _ = load_checkpoint(path)
    assert 0 < resumed.progress < 1
    resumed.train()
    assert resumed.history == whole.history
    ours, theirs = (trainer.actor.state_dict() for trainer in (resumed, whole))
    assert "observation_std" in ours
    assert all(torch.equal(ours[name], theirs[name]) for name in theirs)


def test_statistics_of_other_observations_are_refused(tmp_path: Path) -> None:
    trainer = Trainer("CartPole-v1", PAPER, 3)
    state = trainer.state()
    for normaliser in (None, {"count": 3.0, "mean": [0.0], "var": [1.0]}):
        save_checkpoint(trainer, tmp_path / "state", state | {"normaliser": normaliser})
        with pytest.raises(TrainingError, match="mean and variance"):
            load_checkpoint(tmp_path / "state")


class Far(gymnasium.Env[Any, Any]):
    """Pays where the action is the sign of a signal of 1e-3 around 1000; its other feature is
    constant."""

    observation_space = gymnasium.spaces.Box(-2000, 2000, (2,), np.float64)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.left = 20
        return self._draw(), {}

    def _draw(self) -> Any:
        self.signal = self.np_random.uniform(-1, 1)
        return np.array([1000 + 1e-3 * self.signal, 7.0])

    def step(self, action: Any) -> Any:
        reward = float((action == 1) == (self.signal > 0))
        self.left -= 1
        return self._draw(), reward, self.left == 0, False, {}


@pytest.fixture
def far() -> Any:
    gymnasium.register("Far-v0", Far)
    yield "Far-v0"
    del gymnasium.registry["Far-v0"]


@pytest.mark.parametrize("model", ["svqc", "fcn"])
def test_what_is_far_and_faint_is_learned_and_scored(far: str, model: Any) -> None:
    """Without the setting chance alone pays: 10 of 20. The score plays by the kept numbers."""
    settings = Settings(
        model=model, episodes=80, actor_lr=0.02, critic_hidden=(8,), weight_spread=0.1,
        environments=1, gamma=0.0, critic_lr=0.01,
    )  # fmt: skip
    scores = []
    for normalise in (False, True):
        trainer = Trainer(far, settings.changed(normalise=normalise), 0)
        trainer.train()
        scores.append(score(trainer, 20, 100).mean())
    assert scores[0] < 13
    assert scores[1] > 15


def test_networks_keep_the_numbers_and_play_as_they_learned() -> None:
    settings = settings_for("tuned", "CartPole-v1", "fcn").changed(normalise=True, episodes=4)
    trainer = Trainer("CartPole-v1", settings, 0)
    network = trainer.train().policy
    assert isinstance(network, Network)
    assert trainer.normaliser is not None
    observations = np.random.default_rng(0).normal(size=(50, 4))
    mean, std = trainer.normaliser.statistics
    with torch.no_grad():
        logits = trainer.model(torch.from_numpy((observations - mean) / std)).numpy()
    np.testing.assert_allclose(network.logits(observations), logits, rtol=1e-4, atol=1e-5)


def test_steps_of_earlier_rollouts_are_counted_once() -> None:
    """`rollouts` = 3 learns from every step three times; mean and std are those of the steps."""
    counts = []
    for rollouts in (1, 3):
        trainer = Trainer("CartPole-v1", STEPPED.changed(rollouts=rollouts), 0)
        trainer.train()
        assert trainer.normaliser is not None
        counts.append(trainer.normaliser.state()["count"])
    assert counts == [640, 640]


def test_what_is_normalised_already_is_refused() -> None:
    policy = load_policy("cartpole")
    assert isinstance(policy, Policy)
    own = replace(policy, encoder=replace(policy.encoder, mean=np.zeros(4), std=np.ones(4)))
    settings = PAPER.changed(layout="own", scales=(1.0,))
    with pytest.raises(TrainingError, match="policy cartpole already has its own mean or std"):
        Trainer("CartPole-v1", settings, 0, ansatz=Ansatz.of_policy(own))
    with pytest.raises(TrainingError, match="These circuits read bits"):
        Trainer("FrozenLake-v1", PAPER.changed(encoder="bits"), 0)
