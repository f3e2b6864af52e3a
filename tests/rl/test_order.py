"""Episodes in the order in which they began, however they end."""

from __future__ import annotations

import numpy as np

from qcompile.rl.order import in_order_of_start
from qcompile.rl.rollout import Collector


def played(lengths: list[list[int]]) -> list[tuple[int, float]]:
    """(decisions, reward) of environments that play these lengths, in the order of ends.

    The reward is 100 times when the episode began, and its environment.
    """
    ends = []
    for lane, row in enumerate(lengths):
        start = 0
        for length in row:
            ends.append((start + length, lane, 100.0 * start + lane))
            start += length
    return [((time - 1) * len(lengths) + lane + 1, reward) for time, lane, reward in sorted(ends)]


def test_one_environment_ends_its_episodes_in_their_order() -> None:
    episodes = played([[3, 1, 4, 1, 5]])
    assert [*in_order_of_start(episodes, 1)] == [reward for _, reward in episodes]


def test_two_environments_by_hand() -> None:
    """Begun: 0 in both, then 2, 3, 5 in the second, 7 in the first; the ends are 2 3 5 6 7 9."""
    episodes = played([[7, 2], [2, 1, 2, 1]])
    assert [reward for _, reward in episodes] == [1.0, 201.0, 301.0, 501.0, 0.0, 700.0]
    assert [*in_order_of_start(episodes, 2)] == [0.0, 1.0, 201.0, 301.0, 501.0]


def test_what_began_after_the_first_unfinished_waits() -> None:
    """The last episode of the first environment, begun at 7, is cut off; so begin 8 and 9."""
    episodes = played([[7], [2, 6, 1, 1]])
    assert [*in_order_of_start(episodes, 2)] == [0.0, 1.0, 201.0]


def test_many_environments_against_sorting() -> None:
    rng = np.random.default_rng(0)
    lengths = [rng.integers(1, 30, 200).tolist() for _ in range(8)]
    found = [*in_order_of_start(played(lengths), 8)]
    ends = [sum(row) for row in lengths]
    begun = sorted((100.0 * start + lane) for lane, row in enumerate(lengths)
                   for start in np.cumsum([0, *row[:-1]]) if start < min(ends))  # fmt: skip
    assert found[: len(begun)] == begun


def test_the_shortest_episodes_do_not_come_first() -> None:
    """Rewards are lengths, uniform in 1 to 99: the first 20 of 64 average 50 +- 28.6 / sqrt(20).

    In the order of their ends they are the 20 shortest of 64, at 16 on average.
    """
    rng = np.random.default_rng(1)
    firsts, ended = [], []
    for _ in range(200):
        ends = []
        for lane in range(64):
            time = 0
            for length in rng.integers(1, 100, 8):
                time += int(length)
                ends.append((time, lane, float(length)))
        ends.sort()
        episodes = [((time - 1) * 64 + lane + 1, reward) for time, lane, reward in ends]
        ended.append(np.mean([reward for _, reward in episodes[:20]]))
        firsts.append(np.mean([*in_order_of_start(episodes, 64)][:20]))
    error = 28.6 / np.sqrt(20 * 200)
    assert abs(np.mean(firsts) - 50) < 4 * error
    assert np.mean(ended) < 20


def test_the_decisions_of_a_collector_tell_the_order() -> None:
    """CartPole pays 1 a step: each reward is the length of the episode that began next."""
    made = Collector("CartPole-v1", 3, np.random.SeedSequence(0))
    rng = np.random.default_rng(2)
    rollout = made.collect(lambda seen: rng.integers(2, size=3), 300)
    begun = []
    for lane in range(3):
        start = 0
        for end in np.flatnonzero(rollout.done[:, lane]):
            begun.append((start, lane, float(end + 1 - start)))
            start = int(end) + 1
        begun.append((start, lane, np.nan))
    begun.sort()
    whole = [reward for _, _, reward in begun]
    expected = whole[: int(np.flatnonzero(np.isnan(whole))[0])]
    finished = [(episode.decisions, episode.reward) for episode in made.history]
    assert [*in_order_of_start(finished, 3)] == expected
    made.close()
