"""The average of a model over the updates of a training."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from qcompile.errors import TrainingError
from qcompile.rl.average import Average
from qcompile.rl.ppo import Trainer
from qcompile.rl.settings import Settings

SETTINGS = Settings(environments=2, horizon=16, steps=320, actor_lr=0.02, average_share=0.5)


def averaged(share: float, numbers: list[float]) -> float:
    """The average after a model of one parameter had these values."""
    model = torch.nn.Linear(1, 1, bias=False).double()
    average = Average(model, torch.nn.Linear(1, 1, bias=False).double(), share)
    for number in numbers:
        model.weight.data.fill_(number)
        average.add(model)
    return float(average.model.weight.item())


def test_a_share_of_one_is_the_mean() -> None:
    numbers = [3.0, -1.0, 4.0, 1.0, -5.0, 9.0]
    assert averaged(1.0, numbers) == pytest.approx(np.mean(numbers))


def test_a_share_of_a_half_weighs_updates_by_their_number() -> None:
    """1 / (1 + (t - 1) / 2) is 2 / (t + 1), whose weights are 1, 2, 3, ..., as is told by hand."""
    numbers = [3.0, -1.0, 4.0, 1.0, -5.0, 9.0]
    assert averaged(0.5, numbers) == pytest.approx(np.average(numbers, weights=range(1, 7)))


def test_the_mean_age_of_what_is_averaged() -> None:
    """Of weights s^9 the mean of s / t is 10 / 11 in the limit."""
    count = 2000
    age = 1 - averaged(0.1, [s / count for s in range(1, count + 1)])
    assert age == pytest.approx(1 / 11, abs=1e-3)


def test_a_training_hands_over_the_average_of_what_it_was() -> None:
    """Ten updates, weighing 1 to 10; what acts and learns is that of a training without average."""
    trainer = Trainer("CartPole-v1", SETTINGS, 5)
    seen: list[np.ndarray] = []
    result = trainer.train(
        on_update=lambda: seen.append(trainer.actor.head.weights.detach().numpy().copy())  # type: ignore[union-attr, operator]
    )
    expected = np.average(seen, axis=0, weights=range(1, 11))
    assert len(seen) == 10
    assert result.policy is not None
    np.testing.assert_allclose(result.policy.weights, expected, rtol=1e-5, atol=1e-7)
    assert result.actor is trainer.model is not trainer.actor
    last = Trainer("CartPole-v1", replace(SETTINGS, average_share=0.0), 5)
    without = last.train()
    assert without.actor is last.model is last.actor
    assert without.episodes == result.episodes
    np.testing.assert_array_equal(last.actor.head.weights.detach(), seen[-1])  # type: ignore[union-attr, operator]


def test_an_average_and_algorithm_2_are_not_both_kept() -> None:
    with pytest.raises(TrainingError, match=r"average_share=0 or pause_at=none"):
        replace(SETTINGS, pause_at=10.0).check()
