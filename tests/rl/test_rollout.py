"""Experience from environments whose every reward is known."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.errors import EnvironmentMismatchError
from qcompile.rl.rollout import Collector, FinishedEpisode


def collector(name: str, count: int) -> Collector:
    return Collector(name, count, np.random.SeedSequence(0))


def test_resets_leave_no_trace() -> None:
    """Seven steps over episodes of three: 1 2 3, 1 2 3, 1."""
    made = collector("Clock-v0", 2)
    assert (made.features, made.actions) == (2, 3)
    rollout = made.collect(lambda seen: np.array([0, 2]), 7)
    episodes = np.array([1, 1, 1, 2, 2, 2, 3])
    steps = np.array([1, 2, 3, 1, 2, 3, 1])
    for e, bonus in ((0, 0.0), (1, 1.0)):
        np.testing.assert_array_equal(rollout.rewards[:, e], 10 * episodes + steps + bonus)
        seen, led_to = rollout.observations[:, e], rollout.next_observations[:, e]
        np.testing.assert_array_equal(seen, np.stack([episodes, steps - 1], axis=1))
        np.testing.assert_array_equal(led_to, np.stack([episodes, steps], axis=1))
    assert rollout.actions.tolist() == [[0, 2]] * 7
    # the first episode terminates, the second is cut by the time limit, the third lives on
    assert np.flatnonzero(rollout.terminated[:, 0]).tolist() == [2]
    assert np.flatnonzero(rollout.truncated[:, 0]).tolist() == [5]
    np.testing.assert_array_equal(rollout.done, rollout.terminated | rollout.truncated)
    assert rollout.observations.dtype == np.float32
    # rewards of episode e: 3 * 10 e + 1 + 2 + 3, and 3 * 1 more where the action is 2
    assert rollout.finished == [
        FinishedEpisode(1, 5, 36.0),
        FinishedEpisode(2, 6, 39.0),
        FinishedEpisode(3, 11, 66.0),
        FinishedEpisode(4, 12, 69.0),
    ]
    assert (made.steps, len(made.history)) == (14, 4)
    made.close()


def test_the_next_rollout_goes_on_where_the_last_one_stopped() -> None:
    made = collector("Clock-v0", 1)
    first = made.collect(lambda seen: np.array([0]), 2)
    second = made.collect(lambda seen: np.array([0]), 2)
    assert first.finished == []
    np.testing.assert_array_equal(second.observations[:, 0], [[1, 2], [2, 0]])
    assert second.finished == [FinishedEpisode(1, 3, 36.0)]
    made.close()


def test_without_a_horizon_one_whole_episode_is_collected() -> None:
    made = collector("Clock-v0", 1)
    for episode in (1, 2, 3):
        rollout = made.collect(lambda seen: np.array([1]), None)
        assert rollout.rewards.shape == (3, 1)
        assert rollout.finished == [FinishedEpisode(episode, 3 * episode, 30.0 * episode + 7.5)]
        assert bool(rollout.terminated[-1, 0]) == (episode % 2 == 1)
        assert rollout.done.sum() == 1
    made.close()


def test_a_step_may_terminate_and_be_truncated() -> None:
    made = collector("ClockBoth-v0", 1)
    rollout = made.collect(lambda seen: np.array([0]), 4)
    assert rollout.terminated[:, 0].tolist() == [False, True, False, False]
    assert rollout.truncated[:, 0].tolist() == [False, True, False, True]
    assert len(rollout.finished) == 2
    made.close()


def test_the_policy_sees_what_is_recorded() -> None:
    seen = []

    def act(observations: np.ndarray) -> np.ndarray:
        seen.append(observations.copy())
        return np.zeros(2, dtype=int)

    made = collector("Clock-v0", 2)
    rollout = made.collect(act, 5)
    np.testing.assert_array_equal(np.stack(seen), rollout.observations)
    made.close()


def test_environments_start_from_different_seeds() -> None:
    made = collector("CartPole-v1", 3)
    first = made.collect(lambda seen: np.zeros(3, dtype=int), 1).observations[0]
    assert len({tuple(row) for row in first.tolist()}) == 3
    again = collector("CartPole-v1", 3)
    np.testing.assert_array_equal(
        again.collect(lambda seen: np.zeros(3, dtype=int), 1).observations[0], first
    )
    made.close()
    again.close()


def test_continuous_actions_are_refused() -> None:
    with pytest.raises(EnvironmentMismatchError, match="Pendulum-v1 acts in Box"):
        collector("Pendulum-v1", 1)
