"""Averages by hand, and rows that are in the file as soon as they are added."""

from __future__ import annotations

from pathlib import Path

import pytest

from qcompile.errors import OutputError
from qcompile.report.training_log import Averages, EpisodeLog
from qcompile.rl.rollout import FinishedEpisode


def test_averages_by_hand() -> None:
    averages = Averages()
    assert (averages.last, averages.best) == (None, None)
    averages.add(-3.0)
    averages.add(4.0)
    assert (averages.last, averages.best) == (0.5, None)
    for _ in range(18):
        averages.add(-0.5)  # -8 / 20 with the first two
    assert averages.last == averages.best == pytest.approx(-0.4)
    averages.add(5.0)  # -3 leaves: 0 in all
    assert averages.last == averages.best == pytest.approx(0.0)
    averages.add(3.0)  # 4 leaves: -1 in all
    assert (averages.last, averages.best) == (pytest.approx(-0.05), pytest.approx(0.0))


def test_averages_go_on_from_earlier_rewards() -> None:
    rewards = [float(i % 7) for i in range(50)]
    whole, halves = Averages(rewards), Averages(rewards[:33])
    for reward in rewards[33:]:
        halves.add(reward)
    assert (whole.last, whole.best) == (halves.last, halves.best)


def test_a_row_is_in_the_file_at_once_and_only_once(tmp_path: Path) -> None:
    path = tmp_path / "logs" / "a.csv"
    first, second = FinishedEpisode(1, 20, 1.5), FinishedEpisode(2, 41, -100.0)
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
