"""Updates that learn from the latest rollouts together."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from qcompile.errors import TrainingError
from qcompile.rl.memory import Memory
from qcompile.rl.ppo import Trainer
from qcompile.rl.rollout import Collector, Rollout
from qcompile.rl.settings import Settings

SETTINGS = Settings(environments=2, horizon=16, steps=160, rollouts=3)


def rollout(steps: int, value: float) -> Rollout:
    """Steps of two environments, every number of them `value`."""
    full = np.full((steps, 2), value)
    flags = np.zeros((steps, 2), dtype=bool)
    seen = np.full((steps, 2, 4), value, dtype=np.float32)
    return Rollout(seen, full.astype(np.intp), full, seen, flags, flags, [])


def test_one_rollout_is_handed_on_as_it_is() -> None:
    memory = Memory(1)
    for value in (1.0, 2.0):
        new, residual = rollout(3, value), [torch.ones(6, 4)]
        both = memory.joined(new, residual)
        assert both[0] is new
        assert both[1] is residual
    assert memory.state() == []


def test_the_latest_rollouts_are_joined_the_oldest_first() -> None:
    memory = Memory(3)
    for value in (1.0, 2.0, 3.0):
        memory.joined(rollout(2, value), [torch.full((4, 1), value)])
    joined, (residual,) = memory.joined(rollout(1, 4.0), [torch.full((2, 1), 4.0)])
    assert joined.rewards[:, 0].tolist() == [2, 2, 3, 3, 4]
    assert joined.observations[:, 1, 3].tolist() == [2, 2, 3, 3, 4]
    assert residual[:, 0].tolist() == [2] * 4 + [3] * 4 + [4] * 2


def test_an_update_learns_from_all_of_them() -> None:
    """Steps of the columns that are cut into minibatches: 32, 64, 96, 96, 96."""
    trainer = Trainer("CartPole-v1", replace(SETTINGS, epochs=1), 0)
    cut, lengths = trainer._learner._minibatches, []

    def counted(columns: list[torch.Tensor]) -> Any:
        lengths.append({len(column) for column in columns})
        return cut(columns)

    trainer._learner._minibatches = counted  # type: ignore[method-assign]
    trainer.train()
    assert lengths == [{32}, {64}, {96}, {96}, {96}]


def kept(steps: int = 5) -> dict[str, torch.Tensor]:
    """A rollout of CartPole in a checkpoint."""
    memory = Memory(2)
    memory.joined(rollout(steps, 1.0), [])
    (state,) = memory.state()
    return state


WRONG = {
    "a column missing": {"rewards": None},
    "another length": {"rewards": torch.zeros(4, 2).double()},
    "another number of environments": {"terminated": torch.zeros(5, 3, dtype=torch.bool)},
    "another number of features": {"observations": torch.zeros(5, 2, 3)},
    "another type": {"rewards": torch.zeros(5, 2)},
    "not a number": {"rewards": torch.full((5, 2), torch.nan).double()},
    "an action that there is not": {"actions": torch.full((5, 2), 2)},
    "noise where there is none": {"residual": torch.zeros(10, 4)},
}


@pytest.mark.parametrize("change", WRONG)
def test_what_is_not_a_rollout_of_the_training_is_refused(change: str) -> None:
    collector = Collector("CartPole-v1", 2, np.random.SeedSequence(0))
    state = {k: v for k, v in (kept() | WRONG[change]).items() if v is not None}
    Memory(2).restore([kept()], collector, None)
    with pytest.raises(TrainingError, match="does not belong to its training"):
        Memory(2).restore([state], collector, None)
    collector.close()


def test_a_rollout_of_no_steps_and_too_many_rollouts_are_refused() -> None:
    collector = Collector("CartPole-v1", 2, np.random.SeedSequence(0))
    with pytest.raises(TrainingError, match="does not belong to its training"):
        Memory(2).restore([kept(0)], collector, None)
    with pytest.raises(TrainingError, match="more rollouts than its settings allow"):
        Memory(2).restore([kept(), kept()], collector, None)
    collector.close()
