"""Films: their rate, their size, and that they appear whole or not at all."""

from __future__ import annotations

import re
import subprocess
import tempfile
from pathlib import Path

import imageio.v3
import imageio_ffmpeg
import numpy as np
import pytest

from qcompile.errors import EnvironmentStepError, OutputError
from qcompile.report.film import Film, _shrunk


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Drafts are made in a folder of their own, so that what is left over is seen."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def frames(count: int, height: int = 64, width: int = 96) -> list[np.ndarray]:
    """Grey frames that grow brighter."""
    return [np.full((height, width, 3), 10 * i, dtype=np.uint8) for i in range(count)]


def read_mp4(path: Path) -> tuple[float, tuple[int, int], np.ndarray]:
    """Frames per second, (height, width), and the frames, as ffmpeg itself reads them."""
    words = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt"]
    ended = subprocess.run([*words, "rgb24", "-"], capture_output=True, check=True)
    found = re.search(r"Video: h264.*?, (\d+)x(\d+)[, ].*?, ([\d.]+) fps", ended.stderr.decode())
    assert found is not None
    height, width = int(found[2]), int(found[1])
    seen = np.frombuffer(ended.stdout, np.uint8).reshape(-1, height, width, 3)
    return float(found[3]), (height, width), seen


@pytest.mark.parametrize("fps", [15.0, 30.0, 50.0])
def test_an_mp4_has_every_frame_at_the_environment_s_rate(tmp_path: Path, fps: float) -> None:
    path = tmp_path / "films" / "a.mp4"
    with Film(path) as film:
        for frame in frames(20):
            film.add(frame, fps)
        assert not path.exists(), "it is there before it is whole"
    rate, size, seen = read_mp4(path)
    assert (rate, size, len(seen)) == (fps, (64, 96), 20)
    np.testing.assert_allclose(seen[:, 32, 48, 0], 10 * np.arange(20), atol=4)


def test_a_gif_has_every_second_frame_at_half_the_size(tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    with Film(path) as film:
        for frame in frames(9):
            film.add(frame, 25.0)
    assert imageio.v3.imread(path).shape == (5, 32, 48, 3)
    assert imageio.v3.immeta(path)["duration"] == 80  # ms: two frames of a 25th of a second
    assert path.read_bytes()[:6] == b"GIF89a"


@pytest.mark.parametrize("line", [20, 21])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_gif_keeps_lines_of_one_pixel(tmp_path: Path, line: int, axis: int) -> None:
    """As CartPole's track is: black on white, in an even or an odd row."""
    frame = np.full((64, 96, 3), 255, dtype=np.uint8)
    np.moveaxis(frame, axis, 0)[line] = 0
    path = tmp_path / "a.gif"
    with Film(path) as film:
        film.add(frame, 30.0)
    lines = np.moveaxis(imageio.v3.imread(path, index=0), axis, 0)
    assert abs(int(lines[10].max()) - 128) < 8
    assert (np.delete(lines, 10, axis=0) > 247).all()


def test_a_pixel_of_a_gif_is_the_mean_of_four(tmp_path: Path) -> None:
    frame = np.zeros((4, 4, 3), dtype=np.uint8)
    frame[:2, :2, 0] = [[10, 20], [30, 44]]
    assert _shrunk(frame)[0, 0].tolist() == [26, 0, 0]
    assert _shrunk(frame[:3, :1])[:, 0, 0].tolist() == [20, 0]


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_frames_of_odd_sizes_are_taken(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    with Film(path) as film:
        for frame in frames(4, 63, 95):
            film.add(frame, 30.0)
    if suffix == ".mp4":  # the last row and column are left out
        _, size, seen = read_mp4(path)
        assert (size, len(seen)) == ((62, 94), 4)
    else:
        assert imageio.v3.imread(path).shape == (2, 32, 48, 3)


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
@pytest.mark.parametrize("taken", [0, 5])
def test_a_block_that_raises_leaves_nothing(
    tmp_path: Path, temporary: Path, suffix: str, taken: int
) -> None:
    path = tmp_path / f"a{suffix}"

    def roll() -> None:
        with Film(path) as film:
            for frame in frames(taken):
                film.add(frame, 30.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        roll()
    assert list(tmp_path.iterdir()) == [temporary]
    assert not list(temporary.iterdir())


def test_a_film_that_fails_leaves_the_one_that_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    path.write_bytes(b"old")

    def roll() -> None:
        with Film(path) as film:
            film.add(frames(1)[0], 30.0)
            raise ValueError("torn")

    with pytest.raises(ValueError, match="torn"):
        roll()
    assert path.read_bytes() == b"old"


def test_without_frames_there_is_no_file(tmp_path: Path, temporary: Path) -> None:
    with Film(tmp_path / "a.mp4"):
        pass
    assert list(tmp_path.iterdir()) == [temporary]
    assert not list(temporary.iterdir())


def test_a_place_that_cannot_be_written_is_refused_at_once(tmp_path: Path, temporary: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="Cannot write"):
        Film(tmp_path / "file" / "a.mp4")
    assert not list(temporary.iterdir())


def test_frames_of_an_mp4_keep_their_size(tmp_path: Path) -> None:
    (first,), (second,) = frames(1), frames(1, height=66)
    with Film(tmp_path / "film.mp4") as film:
        film.add(first, 30)
        with pytest.raises(EnvironmentStepError, match=r"\(64, 96\), then \(66, 96\)"):
            film.add(second, 30)
