"""Averages by hand, and rows that are in the file as soon as they are added."""

from __future__ import annotations

from pathlib import Path

import pytest

from qcompile.errors import OutputError
from qcompile.rl.rollout import FinishedEpisode
from qcompile.rl.training_log import Averages, EpisodeLog


def finished(rewards: list[float]) -> list[FinishedEpisode]:
    """Episodes of ten steps, one after the other."""
    return [FinishedEpisode(i, 10 * i, reward, 10 * i) for i, reward in enumerate(rewards, 1)]


def test_averages_by_hand() -> None:
    averages = Averages()
    assert (averages.last, averages.best) == (None, None)
    episodes = iter(finished([-3.0, 4.0, *[-0.5] * 18, 5.0, 3.0]))
    averages.add(next(episodes))
    averages.add(next(episodes))
    assert (averages.last, averages.best) == (0.5, None)
    for _ in range(18):
        averages.add(next(episodes))  # -8 / 20 with the first two
    assert averages.last == averages.best == pytest.approx(-0.4)
    averages.add(next(episodes))  # -3 leaves: 0 in all
    assert averages.last == averages.best == pytest.approx(0.0)
    averages.add(next(episodes))  # 4 leaves: -1 in all
    assert (averages.last, averages.best) == (pytest.approx(-0.05), pytest.approx(0.0))


def test_averages_go_on_from_earlier_episodes() -> None:
    episodes = finished([float(i % 7) for i in range(50)])
    whole, halves = Averages(1, episodes), Averages(1, episodes[:33])
    for episode in episodes[33:]:
        halves.add(episode)
    assert (whole.last, whole.best) == (halves.last, halves.best)


def test_episodes_count_in_the_order_in_which_they_began() -> None:
    """21 environments begin together; number i plays i + 1 steps and earns as much.

    The 20 that end first pay 1 to 20; nothing is known of the order before number 0 has ended.
    """
    averages = Averages(21)
    for i in reversed(range(1, 21)):  # the ends in another order than the numbers
        averages.add(FinishedEpisode(21 - i, 21 * i + i + 1, float(i + 1), 21 * i + i + 1))
        assert averages.last is None
    averages.add(FinishedEpisode(21, 21 * 50 + 1, 51.0, 21 * 50 + 1))
    # In the order of their numbers: 51, 2, 3, ..., 21; 20 in a row are 51 to 20 and 2 to 21.
    assert averages.best == pytest.approx((51 + sum(range(2, 21))) / 20)
    assert averages.last == pytest.approx(sum(range(2, 22)) / 20)


def test_a_row_is_in_the_file_at_once_and_only_once(tmp_path: Path) -> None:
    path = tmp_path / "logs" / "a.csv"
    first, second = FinishedEpisode(1, 20, 1.5, 20), FinishedEpisode(2, 41, -100.0, 41)
    with EpisodeLog(path, [first]) as log:
        assert path.read_text() == "episode,steps,reward\n1,20,1.5\n"
        log.add_missing([second])
        whole = "episode,steps,reward\n1,20,1.5\n2,41,-100.0\n"
        assert path.read_text() == whole
        log.add_missing([first, second])
    assert path.read_text() == whole
    with EpisodeLog(path):
        pass
    assert path.read_text() == "episode,steps,reward\n"


def test_a_file_that_cannot_be_written_is_explained(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="Cannot write"):
        EpisodeLog(tmp_path)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_explained() -> None:
    with pytest.raises(OutputError, match=r"Cannot write /dev/full\.\n  No space left"):
        EpisodeLog(Path("/dev/full"))
