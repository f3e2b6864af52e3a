"""`qcompile run --video`: what is filmed, and what is refused before anything is played."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import pytest

from qcompile.deploy.filming import Frame
from qcompile.report.lettering import Picture
from qcompile.report.scene import Scene
from qcompile.verbs.run import run

Call = Callable[..., Any]


def test_a_film_is_written_whole(qcompile: Call, policy: Call, left: Call) -> None:
    words = ("run", policy(), "--episodes", 2, "--json", "--video", "films/a.gif")
    answer = qcompile(*words)
    assert (answer.code, answer.err) == (0, "film of the first episode in films/a.gif\n")
    assert len(answer.json()["episodes"]) == 2
    assert left() == ["films", "films/a.gif", "tiny.json"]
    assert Path("films/a.gif").read_bytes()[:6] == b"GIF89a"


def test_a_film_has_the_rate_of_the_environment(qcompile: Call, policy: Call) -> None:
    acrobot = policy(
        environment="Acrobot-v1", weights=[[1.0] * 4, [0.0] * 4, [0.0] * 4], bias=[0.0] * 3
    )
    assert qcompile("run", acrobot, "--episodes", 1, "--video", "a.mp4").code == 0
    frames, seconds = imageio_ffmpeg.count_frames_and_secs("a.mp4")
    assert frames / seconds == pytest.approx(15, rel=1e-3)


def test_without_a_frame_there_is_no_film(
    qcompile: Call, policy: Call, left: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def act(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("qcompile.deploy.deployment.Deployment.act", act)
    answer = qcompile("run", policy(), "--video", "a.gif")
    assert answer.code == 1
    first, second, *_ = answer.err.splitlines()
    assert first == "no film: no step was played"
    assert second == "Error: Interrupted: 0 of 20 episodes finished."
    assert left() == ["tiny.json"]


def interrupt(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """Ctrl-C comes while the film's frame of this number is drawn."""
    left = [number]

    def draw(self: Scene, frame: Frame) -> Picture:
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt
        return drawn(self, frame)

    drawn = Scene.draw
    monkeypatch.setattr(Scene, "draw", draw)


@pytest.mark.parametrize("name", ["a.mp4", "a.webm", "a.gif"])
def test_ctrl_c_in_the_middle_keeps_what_was_filmed(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    interrupt(monkeypatch, 6)
    answer = qcompile("run", policy(), "--video", name)
    assert answer.code == 1
    assert answer.err.splitlines()[:2] == [
        f"film of the first episode in {name}",
        "Error: Interrupted: 0 of 20 episodes finished.",
    ]
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(name)
    if name.endswith(".gif"):  # of 50 in a second every other, and the last
        assert frames == 3
    else:
        assert (frames, round(frames / seconds)) == (5, 50)


def test_ctrl_c_within_the_first_frame_leaves_no_film(
    qcompile: Call, policy: Call, left: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt(monkeypatch, 1)
    answer = qcompile("run", policy(), "--video", "a.gif")
    assert answer.code == 1
    assert answer.err.splitlines()[:2] == [
        "no film: no step was played",
        "Error: Interrupted: 0 of 20 episodes finished.",
    ]
    assert left() == ["tiny.json"]


def test_the_python_result_has_the_film(policy: Call) -> None:
    played = run(policy(), "fake_lima", shots=64, episodes=2, max_steps=7, video="a.webm")
    assert played.film is not None
    assert played.film.data == Path("a.webm").read_bytes()
    assert (played.film.width, played.film.frames, played.film.rate) == (640, 7, 50.0)
    assert run(policy(), episodes=1, max_steps=2).film is None


BAD_FILMS = {
    "a.avi": "Error: a.avi must end with .mp4, .gif or .webm.\n",
    "tiny.json/a.gif": """\
Error: Cannot write tiny.json/a.gif.
  tiny.json is not a folder.
  Choose another path.
""",
}


@pytest.fixture
def nothing_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    def play(*_: object, **__: object) -> None:
        pytest.fail("played before the output was checked")

    monkeypatch.setattr("qcompile.deploy.play.play", play)


@pytest.mark.usefixtures("nothing_is_played")
@pytest.mark.parametrize("name", BAD_FILMS)
def test_a_film_that_cannot_be_written_is_refused_at_once(
    qcompile: Call, policy: Call, left: Call, name: str
) -> None:
    answer = qcompile("run", policy(), "--video", name)
    code = 2 if name == "a.avi" else 1
    assert (answer.code, answer.out, answer.err) == (code, "", BAD_FILMS[name])
    assert left() == ["tiny.json"]


@pytest.mark.usefixtures("nothing_is_played")
@pytest.mark.parametrize("film", ["a.gif", "a.mp4"])
@pytest.mark.parametrize("package", ["imageio_ffmpeg", "PIL"])
def test_a_missing_extra_is_named_at_once(
    qcompile: Call, policy: Call, monkeypatch: pytest.MonkeyPatch, package: str, film: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    answer = qcompile("run", policy(), "--video", film)
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: A film needs packages that are not installed.
  Install them with: pip install 'qcompile[video]'
"""
    )
