"""A decision that is held: its rewards, its discount, its steps, and the ends within a hold."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from playing import Clock

from qcompile.policy import AnyPolicy, Policy, load_policy, save_policy
from qcompile.rl.checkpoint import load_checkpoint
from qcompile.rl.ppo import Trainer
from qcompile.rl.rollout import Collector, FinishedEpisode
from qcompile.rl.score import score
from qcompile.rl.settings import Settings


@pytest.fixture(autouse=True)
def slow_clock() -> Iterator[None]:
    """Clock5-v0 is a Clock whose episodes last 5 steps: held for 2 the third decision is cut."""
    gymnasium.register("Clock5-v0", Clock, disable_env_checker=True, kwargs={"length": 5})
    yield
    del gymnasium.registry["Clock5-v0"]


def collector(hold: int, count: int = 1) -> Collector:
    return Collector("Clock5-v0", count, np.random.SeedSequence(0), hold=hold)


def test_a_rollout_of_held_decisions_by_hand() -> None:
    """Step k of episode e pays 10 e + k + action / 2: 1 + 2, 3 + 4 and then 5 alone, plus these."""
    made = collector(2)
    chosen = iter([0, 1, 2, 0, 1, 2, 0])
    rollout = made.collect(lambda seen: np.array([next(chosen)]), 7)
    first = [20 + 3, 20 + 7 + 1, 10 + 5 + 1]
    second = [40 + 3, 40 + 7 + 1, 20 + 5 + 1]
    assert rollout.rewards[:, 0].tolist() == [*first, *second, 60 + 3]
    seen, led_to = rollout.observations[:, 0, 1], rollout.next_observations[:, 0, 1]
    assert seen.tolist() == [0, 2, 4, 0, 2, 4, 0]
    assert led_to.tolist() == [2, 4, 5, 2, 4, 5, 2]
    # the first episode terminates within the hold of its third decision, the second is cut there
    assert np.flatnonzero(rollout.terminated[:, 0]).tolist() == [2]
    assert np.flatnonzero(rollout.truncated[:, 0]).tolist() == [5]
    assert rollout.finished == [
        FinishedEpisode(1, 5, float(sum(first)), 3),
        FinishedEpisode(2, 10, float(sum(second)), 6),
    ]
    assert (made.steps, made.decisions) == (12, 7)
    made.close()


def test_steps_of_several_environments_are_all_counted() -> None:
    """Two clocks, decisions in turn: 2 2, 2 2, 1 1, 2 2 steps; the episodes end after 9 and 10."""
    made = collector(2, count=2)
    rollout = made.collect(lambda seen: np.array([0, 0]), 4)
    ends = [(episode.steps, episode.decisions) for episode in rollout.finished]
    assert ends == [(9, 5), (10, 6)]
    assert (made.steps, made.decisions) == (14, 8)
    made.close()


def test_a_hold_longer_than_an_episode_is_the_episode() -> None:
    made = collector(99)
    rollout = made.collect(lambda seen: np.array([0]), 2)
    assert rollout.rewards[:, 0].tolist() == [50 + 15, 100 + 15]
    assert (rollout.done.all(), made.steps, made.decisions) == (True, 10, 2)
    made.close()


def judged(**changes: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Targets of two episodes of three decisions, and the values before and after each decision."""
    settings = Settings(episodes=1, gamma=0.9, horizon=6, environments=1, hold=2, **changes)
    trainer = Trainer("Clock5-v0", settings, 0)
    targets: list[np.ndarray] = []
    kept = trainer._learner._advantages_and_targets

    def keep(*arguments: Any) -> Any:
        result = kept(*arguments)
        targets.append(result[1].numpy())
        return result

    trainer._learner._advantages_and_targets = keep  # type: ignore[method-assign]
    rollout = trainer._collector.collect(lambda seen: np.array([0]), 6)
    critic = trainer._critic

    def values(observations: np.ndarray) -> np.ndarray:
        import torch

        with torch.no_grad():
            return np.asarray(critic(torch.from_numpy(observations[:, 0]))[:, 0].double().numpy())

    before, after = values(rollout.observations), values(rollout.next_observations)
    trainer._update(rollout)
    return targets[0], before, after


def test_a_decision_is_discounted_for_each_of_its_steps() -> None:
    """gamma = 0.9 a step is 0.81 a decision; what a time limit cuts off is worth the value there.

    The first episode earns 23, 27 and 15 and terminates, the second 43, 47 and 25 and is cut.
    """
    targets, _, after = judged()
    third = 25 + 0.81 * after[5]
    cut = [43 + 0.81 * (47 + 0.81 * third), 47 + 0.81 * third, third]
    whole = [23 + 0.81 * (27 + 0.81 * 15), 27 + 0.81 * 15, 15]
    np.testing.assert_allclose(targets, [*whole, *cut], rtol=1e-6)


def test_lambda_counts_decisions_and_their_cost_is_taken_off() -> None:
    """lambda = 0: the target is the reward less the cost, and 0.81 times the next value."""
    targets, _, after = judged(gae_lambda=0.0, decision_cost=4.0)
    rewards, lives_on = np.array([23, 27, 15, 43, 47, 25]) - 4.0, np.array([1, 1, 0, 1, 1, 1])
    np.testing.assert_allclose(targets, rewards + 0.81 * after * lives_on, rtol=1e-6)


def test_no_score_has_the_cost() -> None:
    """Every reported reward is the environment's."""
    trainer = Trainer("Clock5-v0", Settings(episodes=2, hold=2, decision_cost=4.0), 0)
    result = trainer.train()
    acted = [episode.reward - (5 * 10 * e + 15) for e, episode in enumerate(result.episodes, 1)]
    assert all(0 <= bonus <= 5 for bonus in acted)
    # of the next two episodes, the first of the environments that the score makes
    assert all(65 <= reward <= 70 for reward in score(trainer, 2, 0))


@pytest.mark.parametrize("model", ["svqc", "surrogate", "fcn"])
def test_the_policy_keeps_its_hold(model: Any, tmp_path: Path) -> None:
    settings = Settings(model=model, episodes=2, hold=3)
    policy = Trainer("CartPole-v1", settings, 0).train().policy
    assert policy is not None
    save_policy(policy, tmp_path / "p.json")
    read: AnyPolicy = load_policy(tmp_path / "p.json")
    assert (policy.hold, read.hold) == (3, 3)


@pytest.mark.parametrize("model", ["svqc", "mvqc"])
def test_a_score_is_of_held_decisions(model: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 5 steps held for 2 there are 3 decisions, whether a policy is made or not."""
    trainer = Trainer("Clock5-v0", Settings(model=model, episodes=1, hold=2), 0)
    steps = 0
    step = Clock.step

    def counted(clock: Clock, action: Any) -> Any:
        nonlocal steps
        steps += 1
        if steps % 2 == 1:  # decided at steps 1, 3 and 5
            counted.action = action  # type: ignore[attr-defined]
        assert action == counted.action  # type: ignore[attr-defined]
        return step(clock, action)

    monkeypatch.setattr(Clock, "step", counted)
    score(trainer, 1, 0)
    assert steps == 5


def test_a_checkpoint_of_every_step_decided_is_read_as_it_was(
    tmp_path: Path, saved_at: Any
) -> None:
    """Version 0.1.0 wrote steps and rewards, and no hold."""
    import torch

    path = tmp_path / "run.checkpoint"
    settings = Settings(episodes=20, environments=2, horizon=30)
    saved_at(3, "CartPole-v1", settings, path)
    saved = torch.load(path, weights_only=True)
    values, written = json.loads(saved["plain"]), json.loads(saved["settings"])
    collected = values["collector"]
    del collected["decisions"], written["hold"], written["decision_cost"]
    collected["episodes"] = [entry[:2] for entry in collected["episodes"]]
    assert collected["episodes"]
    whole = load_checkpoint(path)[0].train()
    torch.save(saved | {"plain": json.dumps(values), "settings": json.dumps(written)}, path)
    read, _ = load_checkpoint(path)
    assert read.settings == settings
    assert read.decisions == read.steps == 180
    assert read.train().episodes == whole.episodes


@pytest.mark.parametrize("model", ["svqc", "surrogate"])
def test_a_temperature_sharpens_what_is_handed_over_and_nothing_else(model: Any) -> None:
    """At 1/2 the logits are twice as large: probabilities are squared, and add up to 1 again."""
    settings = Settings(model=model, episodes=3, hold=2)
    warm, cold = (
        Trainer("CartPole-v1", settings.changed(temperature=temperature), 0).train()
        for temperature in (1.0, 0.5)
    )
    assert warm.episodes == cold.episodes
    assert isinstance(warm.policy, Policy)
    assert isinstance(cold.policy, Policy)
    values = np.random.default_rng(0).uniform(-1, 1, (5, len(warm.policy.program)))
    squared = warm.policy.probabilities(values) ** 2
    np.testing.assert_allclose(
        cold.policy.probabilities(values), squared / squared.sum(axis=1, keepdims=True)
    )
