"""Films: their rate, their size, and that they appear whole or not at all."""

from __future__ import annotations

import base64
import io
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, cast

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from qcompile.errors import MissingExtraError, OptionError, OutputError
from qcompile.report import film as films
from qcompile.report.film import Film

SUFFIXES = [".mp4", ".gif", ".webm"]
CODECS = {".mp4": "h264", ".gif": "gif", ".webm": "vp9"}


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Drafts are made in a folder of their own, so that what is left over is seen."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def frames(count: int, height: int = 64, width: int = 96) -> list[np.ndarray]:
    """Grey frames that grow brighter, the first 25 of them."""
    levels = (10 * min(i, 25) for i in range(count))
    return [np.full((height, width, 3), level, dtype=np.uint8) for level in levels]


def shoot(path: Path | None, pictures: list[np.ndarray], rate: float = 25.0) -> Film:
    with Film(path) as film:
        for picture in pictures:
            film.add(picture, rate)
        assert path is None or not path.exists(), "it is there before it is whole"
    return film


def read(path: Path) -> tuple[float, tuple[int, int], np.ndarray]:
    """Frames per second, (height, width), and the frames, as ffmpeg itself reads them."""
    words = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt"]
    ended = subprocess.run([*words, "rgb24", "-"], capture_output=True, check=True)
    pattern = rf"Video: {CODECS[path.suffix]}.*?, (\d+)x(\d+)[, ].*?, ([\d.]+) fps"
    found = re.search(pattern, ended.stderr.decode())
    assert found is not None
    height, width = int(found[2]), int(found[1])
    seen = np.frombuffer(ended.stdout, np.uint8).reshape(-1, height, width, 3)
    return float(found[3]), (height, width), seen


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
@pytest.mark.parametrize("rate", [15.0, 30.0, 50.0])
def test_a_film_has_every_frame_at_the_environment_s_rate(
    tmp_path: Path, suffix: str, rate: float
) -> None:
    path = tmp_path / "films" / f"a{suffix}"
    shoot(path, frames(20), rate)
    shown, size, seen = read(path)
    assert (shown, size, len(seen)) == (rate, (64, 96), 20)
    np.testing.assert_allclose(seen[:, 32, 48, 0], 10 * np.arange(20), atol=6)


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_colours_stay(tmp_path: Path, suffix: str) -> None:
    """Those of the scene's bars, in areas as large as a bar; players know their matrix by name."""
    picture = np.zeros((64, 96, 3), dtype=np.uint8)
    colours = [(86, 180, 233), (240, 228, 66), (230, 159, 0), (19, 23, 31)]
    for i, colour in enumerate(colours):
        picture[:, 24 * i : 24 * (i + 1)] = colour
    path = tmp_path / f"a{suffix}"
    shoot(path, [picture] * 3)
    _, _, seen = read(path)
    np.testing.assert_allclose(seen[1, 32, 12::24], colours, atol=8)


def test_a_gif_has_whole_frames_and_stays_on_the_last(tmp_path: Path) -> None:
    path = tmp_path / "a.gif"
    shoot(path, frames(9), 25.0)
    assert path.read_bytes()[:6] == b"GIF89a"
    assert b"NETSCAPE2.0" in path.read_bytes()  # it begins again
    with Image.open(path) as gif:
        durations, levels = [], []
        for i in range(gif.n_frames):
            gif.seek(i)
            durations.append(gif.info["duration"])
            levels.append(np.asarray(gif.convert("RGB"))[5, 5, 0])
        assert gif.size == (96, 64)
    assert durations == [40] * 8 + [1500]  # ms
    assert levels == [10 * i for i in range(9)]


@pytest.mark.parametrize(
    ("rate", "count", "kept", "duration"),
    [(50.0, 9, [0, 2, 4, 6, 8], 40), (50.0, 10, [0, 2, 4, 6, 8, 9], 40), (60.0, 3, [0, 2], 30)],
)
def test_a_fast_gif_leaves_frames_out_but_not_the_last(
    tmp_path: Path, rate: float, count: int, kept: list[int], duration: int
) -> None:
    path = tmp_path / "a.gif"
    shoot(path, frames(count), rate)
    with Image.open(path) as gif:
        levels = []
        for i in range(gif.n_frames):
            gif.seek(i)
            levels.append(int(np.asarray(gif.convert("RGB"))[5, 5, 0]))
            assert gif.info["duration"] in (duration, duration + 10, 1500)
    assert levels == [10 * i for i in kept]


@pytest.mark.parametrize("line", [20, 21])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_gif_keeps_lines_of_one_pixel(tmp_path: Path, line: int, axis: int) -> None:
    """As CartPole's track is: black on white, in an even or an odd row."""
    picture = np.full((64, 96, 3), 255, dtype=np.uint8)
    np.moveaxis(picture, axis, 0)[line] = 0
    path = tmp_path / "a.gif"
    shoot(path, [picture, picture])
    with Image.open(path) as gif:
        lines = np.moveaxis(np.asarray(gif.convert("RGB")), axis, 0)
    assert (lines[line] < 8).all()
    assert (np.delete(lines, line, axis=0) > 247).all()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_film_of_one_frame(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    shoot(path, frames(2)[1:])
    if suffix == ".gif":
        with Image.open(path) as gif:
            assert getattr(gif, "n_frames", 1) == 1
    else:
        assert len(read(path)[2]) == 1


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("taken", [0, 5])
def test_a_block_that_raises_leaves_nothing(
    tmp_path: Path, temporary: Path, suffix: str, taken: int
) -> None:
    path = tmp_path / f"a{suffix}"

    def roll() -> None:
        with Film(path) as film:
            for picture in frames(taken):
                film.add(picture, 30.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        roll()
    assert list(tmp_path.iterdir()) == [temporary]
    assert not list(temporary.iterdir())


class Interrupted:
    """A pipe that takes half of its third picture; then comes Ctrl-C."""

    def __init__(self, pipe: Any):
        self._pipe, self._left, self.close = pipe, 3, pipe.close

    def write(self, picture: memoryview) -> None:
        self._left -= 1
        if not self._left:
            self._pipe.write(bytes(picture)[: picture.nbytes // 2])
            raise KeyboardInterrupt
        self._pipe.write(picture)


def test_half_a_frame_is_not_in_the_film(tmp_path: Path) -> None:
    """A run that Ctrl-C ends keeps the film of what it has played."""
    path = tmp_path / "a.mp4"
    with Film(path) as film:
        film.add(frames(1)[0], 20.0)
        assert film._process is not None
        film._process.stdin = cast(Any, Interrupted(film._process.stdin))
        film.add(frames(2)[1], 20.0)
        film.add(frames(3)[2], 20.0)
        with pytest.raises(KeyboardInterrupt):
            film.add(frames(4)[3], 20.0)
    assert len(read(path)[2]) == film.frames == 3
    assert film.clip is not None


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
    film = shoot(tmp_path / "a.mp4", [])
    assert film.clip is None
    assert list(tmp_path.iterdir()) == [temporary]
    assert not list(temporary.iterdir())


def test_a_place_that_cannot_be_written_is_refused_at_once(tmp_path: Path, temporary: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="Cannot write"):
        Film(tmp_path / "file" / "a.mp4")
    assert not list(temporary.iterdir())


@pytest.mark.parametrize("name", ["a.avi", "a", "a.MP4"])
def test_an_unknown_suffix_is_refused(name: str) -> None:
    with pytest.raises(OptionError, match=rf"{name} must end with .mp4, .gif or .webm\."):
        Film(Path(name))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_ffmpeg_without_the_encoder_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    """Before anything is filmed; as one that does not run at all."""
    poor = tmp_path / "ffmpeg"
    poor.write_text("#!/bin/sh\necho ' V....D mpeg4   MPEG-4 part 2'\n")
    poor.chmod(0o755)
    encoder = {".mp4": "libx264", ".gif": "libx264rgb", ".webm": "libvpx-vp9"}[suffix]
    for program in (poor, tmp_path / "none"):
        monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", lambda: str(program))  # noqa: B023
        with pytest.raises(OutputError, match=f"{program} has no {encoder}"):
            Film(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("package", ["imageio_ffmpeg", "PIL"])
def test_missing_packages_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=r"pip install 'qcompile\[video\]'"):
        Film(tmp_path / "a.mp4")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_ffmpeg_says_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, temporary: Path, suffix: str
) -> None:
    """It ends with an error: an option that it does not know."""
    known = films._FORMATS[suffix]
    monkeypatch.setitem(films._FORMATS, suffix, known._replace(options=("-nonsense", "1")))
    with pytest.raises(OutputError, match=r"cannot be encoded\.\n  .*nonsense"):
        shoot(tmp_path / f"a{suffix}", frames(40, 512, 512))
    assert list(tmp_path.iterdir()) == [temporary]
    assert not list(temporary.iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_clip_is_the_film_and_a_still_of_it(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    clip = shoot(path, frames(12), 20.0).clip
    assert clip is not None
    assert clip.data == path.read_bytes()
    assert (clip.width, clip.height, clip.frames, clip.seconds) == (96, 64, 12, 0.6)
    with Image.open(io.BytesIO(clip.poster)) as still:
        assert (still.format, still.size) == ("PNG", (96, 64))
        assert np.asarray(still)[0, 0, 0] == 10 * (8 - 1)  # the eighth of twelve


@pytest.mark.parametrize(("count", "still"), [(1, 1), (2, 1), (3, 2), (11, 4), (12, 8), (24, 16)])
def test_the_still_is_from_the_middle(count: int, still: int) -> None:
    clip = shoot(None, frames(count)).clip
    assert clip is not None
    with Image.open(io.BytesIO(clip.poster)) as picture:
        assert np.asarray(picture)[0, 0, 0] == 10 * (still - 1)


def test_a_clip_without_a_file_is_an_mp4(tmp_path: Path, temporary: Path) -> None:
    clip = shoot(None, frames(3)).clip
    assert clip is not None
    assert clip.media_type == "video/mp4"
    assert clip.data[4:8] == b"ftyp"
    assert list(tmp_path.iterdir()) == [temporary]


@pytest.mark.parametrize(
    ("suffix", "element"), [(".mp4", "video"), (".webm", "video"), (".gif", "img")]
)
def test_a_notebook_shows_a_clip(tmp_path: Path, suffix: str, element: str) -> None:
    clip = shoot(tmp_path / f"a{suffix}", frames(3)).clip
    assert clip is not None
    shown = clip.html('"><script>')
    assert shown.startswith(f"<{element} ")
    assert "<script>" not in shown
    found = re.search(r'src="data:([^;]+);base64,([^"]+)"', shown)
    assert found is not None
    assert found[1] == clip.media_type
    assert base64.b64decode(found[2]) == clip.data
    assert clip._repr_html_().startswith(f"<{element} ")
