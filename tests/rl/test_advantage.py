"""Advantages against their definitions, summed the slow way."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.rl.advantage import ReturnScale, generalised_advantage

GAMMA = 0.93


def experience(seed: int, steps: int = 40, environments: int = 3) -> dict[str, np.ndarray]:
    """Random steps; about one in six ends an episode, half of those by a time limit."""
    rng = np.random.default_rng(seed)
    shape = (steps, environments)
    terminated, truncated = rng.random(shape) < 0.08, rng.random(shape) < 0.08
    return {
        "rewards": rng.normal(size=shape),
        "values": rng.normal(size=shape),
        "next_values": rng.normal(size=shape),
        "terminated": terminated,
        "done": terminated | truncated,
    }


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("gae_lambda", [0.0, 0.9, 1.0])
def test_gae_is_the_sum_of_its_definition(seed: int, gae_lambda: float) -> None:
    """A_t = sum over k of (gamma lambda)^k delta_(t+k), up to the end of the episode."""
    given = experience(seed)
    assert (given["done"] & ~given["terminated"]).any()
    found = generalised_advantage(**given, gamma=GAMMA, gae_lambda=gae_lambda)
    steps, environments = found.shape
    for e in range(environments):
        for t in range(steps):
            total = 0.0
            for k in range(t, steps):
                led_to = 0.0 if given["terminated"][k, e] else given["next_values"][k, e]
                delta = given["rewards"][k, e] + GAMMA * led_to - given["values"][k, e]
                total += (GAMMA * gae_lambda) ** (k - t) * delta
                if given["done"][k, e]:
                    break
            assert found[t, e] == pytest.approx(total, abs=1e-12)


def test_lambda_one_is_the_return_less_the_value() -> None:
    """Rewards 1, 2, 4 and gamma 1/2: returns 3, 4, 4 after termination.

    Cut by a time limit with a value of 8 behind it: 4 + 8/2 = 8, 2 + 8/2 = 6, 1 + 6/2 = 4.
    """
    rewards = np.array([[1.0, 1.0], [2.0, 2.0], [4.0, 4.0]])
    values = np.array([[0.5, 0.0], [-1.0, 3.0], [9.0, 3.0]])
    next_values = np.array([[-1.0, 3.0], [9.0, 3.0], [100.0, 8.0]])
    terminated = np.array([[0, 0], [0, 0], [1, 0]], dtype=bool)
    done = np.array([[0, 0], [0, 0], [1, 1]], dtype=bool)
    found = generalised_advantage(rewards, values, next_values, terminated, done, 0.5, 1.0)
    returns = np.array([[3.0, 4.0], [4.0, 6.0], [4.0, 8.0]])
    np.testing.assert_allclose(found, returns - values, atol=1e-15)


def test_an_unfinished_episode_is_carried_on_by_its_value() -> None:
    """The horizon cuts in the middle: what follows is the value of the state it was left in."""
    none = np.zeros((2, 1), dtype=bool)
    found = generalised_advantage(
        np.array([[1.0], [1.0]]), np.zeros((2, 1)), np.array([[0.0], [6.0]]), none, none, 0.5, 1.0
    )
    np.testing.assert_allclose(found, [[1 + 0.5 * (1 + 0.5 * 6)], [1 + 0.5 * 6]])


def test_nothing_given_is_changed() -> None:
    given = experience(7)
    before = {name: array.copy() for name, array in given.items()}
    generalised_advantage(**given, gamma=GAMMA, gae_lambda=0.9)
    for name, array in given.items():
        np.testing.assert_array_equal(array, before[name])


def test_the_scale_is_the_deviation_of_all_returns_so_far() -> None:
    """Three updates against one numpy.std of the returns of all steps, episode by episode."""
    rng = np.random.default_rng(1)
    rewards, done = 5 + 3 * rng.normal(size=(60, 4)), rng.random((60, 4)) < 0.1
    scale = ReturnScale(4, GAMMA)
    returns: list[float] = []
    running = [0.0] * 4
    for start, stop in ((0, 7), (7, 30), (30, 60)):
        for t in range(start, stop):
            for e in range(4):
                running[e] = GAMMA * running[e] + rewards[t, e]
                returns.append(running[e])
                if done[t, e]:
                    running[e] = 0.0
        found = scale.update(rewards[start:stop], done[start:stop])
        assert found == pytest.approx(np.std(returns), rel=1e-12)


def test_the_scale_is_one_until_returns_differ() -> None:
    scale = ReturnScale(2, GAMMA)
    assert scale.update(np.zeros((5, 2)), np.zeros((5, 2), dtype=bool)) == 1.0
