"""Experience from environments whose every reward is known."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

from qcompile.errors import EnvironmentMismatchError, TrainingError
from qcompile.rl.rollout import Collector, FinishedEpisode, Rollout


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
        FinishedEpisode(1, 5, 36.0, 5),
        FinishedEpisode(2, 6, 39.0, 6),
        FinishedEpisode(3, 11, 66.0, 11),
        FinishedEpisode(4, 12, 69.0, 12),
    ]
    assert (made.steps, len(made.history)) == (14, 4)
    made.close()


def test_the_next_rollout_goes_on_where_the_last_one_stopped() -> None:
    made = collector("Clock-v0", 1)
    first = made.collect(lambda seen: np.array([0]), 2)
    second = made.collect(lambda seen: np.array([0]), 2)
    assert first.finished == []
    np.testing.assert_array_equal(second.observations[:, 0], [[1, 2], [2, 0]])
    assert second.finished == [FinishedEpisode(1, 3, 36.0, 3)]
    made.close()


def test_without_a_horizon_one_whole_episode_is_collected() -> None:
    made = collector("Clock-v0", 1)
    for episode in (1, 2, 3):
        rollout = made.collect(lambda seen: np.array([1]), None)
        assert rollout.rewards.shape == (3, 1)
        assert rollout.finished == [
            FinishedEpisode(episode, 3 * episode, 30.0 * episode + 7.5, 3 * episode)
        ]
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


def drawn(actions: int, count: int, seed: int) -> Callable[[Any], np.ndarray]:
    rng = np.random.default_rng(seed)
    return lambda seen: rng.integers(actions, size=count)


def test_every_episode_has_a_seed_of_its_own() -> None:
    """Each first observation is that of gymnasium's own reset with the seed noted for it."""
    made = collector("CartPole-v1", 2)
    act, seeds = drawn(2, 2, 0), set()
    reference = gymnasium.make("CartPole-v1")
    for _ in range(200):
        walks = made.state()["walks"]
        seen = made.collect(act, 1).observations[0]
        for i, (seed, actions) in enumerate(walks):
            if not actions:
                assert seed not in seeds
                seeds.add(seed)
                np.testing.assert_array_equal(seen[i], reference.reset(seed=seed)[0])
    # those that live on began too, and are not among the finished
    assert len(made.history) > 10
    assert len(made.history) <= len(seeds) <= len(made.history) + 2
    made.close()
    reference.close()


COLUMNS = ("observations", "actions", "rewards", "next_observations", "terminated", "truncated")


def assert_same(first: Rollout, second: Rollout) -> None:
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.finished == second.finished


@pytest.mark.parametrize(
    ("name", "count", "actions", "before"),
    [("CartPole-v1", 3, 2, 67), ("LunarLander-v3", 2, 4, 190), ("Acrobot-v1", 1, 3, 30)],
)
def test_a_restored_collector_goes_on_as_if_undisturbed(
    name: str, count: int, actions: int, before: int
) -> None:
    """In the middle of episodes, after others; the state passes through a file of plain values."""
    undisturbed = collector(name, count)
    undisturbed.collect(drawn(actions, count, 1), before)
    state = json.loads(json.dumps(undisturbed.state()))
    assert all(taken for _, taken in state["walks"]), "an episode has just begun"
    assert state["episodes"] or name == "Acrobot-v1"
    other = Collector(name, count, np.random.SeedSequence(99))
    other.collect(drawn(actions, count, 5), 10)
    other.restore(state)
    assert (other.steps, other.history) == (undisturbed.steps, undisturbed.history)
    assert other.state() == undisturbed.state()
    for horizon in (40, 160):
        rollouts = [
            made.collect(drawn(actions, count, horizon), horizon) for made in (undisturbed, other)
        ]
        assert_same(*rollouts)
    assert other.state() == undisturbed.state()
    undisturbed.close()
    other.close()


def test_a_state_does_not_change_while_the_collector_goes_on() -> None:
    made = collector("CartPole-v1", 2)
    made.collect(drawn(2, 2, 1), 20)
    state = made.state()
    before = json.dumps(state)
    made.collect(drawn(2, 2, 2), 50)
    assert json.dumps(state) == before
    made.close()


def test_a_state_that_is_not_come_to_is_refused() -> None:
    """A wrong observation, another seed, another action, one action less: each tells."""
    made = collector("CartPole-v1", 2)
    made.collect(drawn(2, 2, 1), 15)
    good = json.dumps(made.state())
    made.restore(json.loads(good))

    def refuses(change: Callable[[dict[str, Any]], None]) -> None:
        state = json.loads(good)
        change(state)
        with pytest.raises(TrainingError, match="do not return to their state in the checkpoint"):
            made.restore(state)

    def nudge(state: dict[str, Any]) -> None:
        state["observations"][1][2] += 1e-6

    def other_seed(state: dict[str, Any]) -> None:
        state["walks"][0][0] += 1

    def other_action(state: dict[str, Any]) -> None:
        state["walks"][1][1][-1] ^= 1

    def one_less(state: dict[str, Any]) -> None:
        state["walks"][1][1].pop()

    for change in (nudge, other_seed, other_action, one_less):
        refuses(change)
    made.close()


def test_an_environment_that_its_seed_does_not_repeat_is_refused() -> None:
    """The clock counts its own episodes: a replay does not return to its state."""
    made = collector("Clock-v0", 1)
    made.collect(lambda seen: np.array([0]), 4)
    with pytest.raises(TrainingError, match="do not return to their state in the checkpoint"):
        made.restore(made.state())
    made.close()
