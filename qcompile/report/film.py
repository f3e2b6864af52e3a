"""Films of episodes: pictures in, a file out."""

from __future__ import annotations

import subprocess
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from types import TracebackType
from typing import NamedTuple

import numpy as np

from qcompile.errors import MissingExtraError, OptionError, OutputError
from qcompile.output import check_writable, write_file
from qcompile.report.clip import Clip
from qcompile.report.lettering import Picture
from qcompile.terminal import first_line


class _Format(NamedTuple):
    """How films of a suffix are encoded: by which encoder of ffmpeg, with which of its options."""

    media_type: str
    encoder: str
    options: tuple[str, ...]
    most_rate: float = np.inf
    """Frames in a second that its players show."""


_BT709 = (
    *("-vf", "scale=out_color_matrix=bt709", "-pix_fmt", "yuv420p"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"),
)
"""Pixels that every player shows, and the colours they stand for."""
_FORMATS = {
    ".mp4": _Format(
        "video/mp4",
        "libx264",
        (*_BT709, "-preset", "veryfast", "-crf", "20", "-movflags", "+faststart"),
    ),
    # The palette of a GIF is known when all frames are: until then they are kept without loss.
    ".gif": _Format("image/gif", "libx264rgb", ("-preset", "ultrafast", "-qp", "0"), 30),
    ".webm": _Format(
        "video/webm",
        "libvpx-vp9",
        (
            *_BT709,
            *("-deadline", "realtime", "-cpu-used", "6", "-row-mt", "1"),
            *("-crf", "28", "-b:v", "0"),
        ),
    ),
}
_LAST_FRAME_CS = 150
"""Hundredths of a second that a GIF shows its last frame before it begins again."""


def check_suffix(path: Path) -> None:
    """Nothing, if films can have this suffix.

    Raises:
        OptionError: they cannot.
    """
    if path.suffix not in _FORMATS:
        *most, last = _FORMATS
        raise OptionError(f"{path} must end with {', '.join(most)} or {last}.")


class Film:
    """A film that is encoded while it is taken; at its end it is at `path`, whole, and a `clip`.

    Without a path it is an MP4 and a `clip` alone. A block that raises leaves neither.

    Raises:
        OptionError: its suffix is not that of a film.
        OutputError: there can be no file at `path`, or ffmpeg cannot encode it; found before
            anything is filmed.
        MissingExtraError: the packages that encode are not installed.
    """

    def __init__(self, path: Path | None = None):
        self.path, suffix = path, ".mp4"
        if path is not None:
            check_suffix(path)
            check_writable(path)
            suffix = path.suffix
        self._format = _FORMATS[suffix]
        self._ffmpeg = _ffmpeg_with(self._format.encoder, suffix)
        self._folder = TemporaryDirectory(prefix="qcompile-film-")
        folder = Path(self._folder.name)
        self._said = TemporaryFile()  # noqa: SIM115 - what ffmpeg says: closed when the film ends
        self._draft = folder / ("draft.mkv" if suffix == ".gif" else f"draft{suffix}")
        self._process: subprocess.Popen[bytes] | None = None
        self._every, self._rate = 1, 1.0
        self._last: Picture | None = None
        """The last picture, where it is not in the film yet."""
        self._stills: list[tuple[int, Picture]] = []
        self.frames = 0
        self._keeps_earlier = False
        self.clip: Clip | None = None

    def __enter__(self) -> Film:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        try:
            if kind is None and self.frames and not self._keeps_earlier:
                self._finish()
        finally:
            self._end()
            self._said.close()
            self._folder.cleanup()

    def keep_earlier(self) -> None:
        """Make no film where `path` has one already: this one is not worth more."""
        self._keeps_earlier = self.path is not None and self.path.exists()

    def _end(self) -> None:
        """Leave no process behind."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            if self._process.stdin is not None:
                with suppress(OSError):  # what was not written yet finds no reader
                    self._process.stdin.close()

    def add(self, picture: Picture, rate: float) -> None:
        """Take the next frame, (height, width, 3), both even; `rate` of them make a second.

        All have the size and the rate of the first.

        Raises:
            OutputError: it cannot be encoded.
        """
        if self._process is None:
            self._begin(picture, rate)
        self._last = picture
        if self.frames % self._every == 0:
            self._write()
        self.frames += 1  # Ctrl-C within a frame: it is not there
        if self.frames & (self.frames - 1) == 0:
            self._stills = [*self._stills[-1:], (self.frames, picture)]

    def _begin(self, picture: Picture, rate: float) -> None:
        height, width = picture.shape[:2]
        self._every = -int(-rate // self._format.most_rate) if rate > self._format.most_rate else 1
        self._rate = rate
        shown = str(Fraction(rate / self._every).limit_denominator(100_000))
        words = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", shown]
        words += ["-i", "-", "-an", "-c:v", self._format.encoder, *self._format.options]
        self._process = subprocess.Popen(
            [*self._ffmpeg, *words, str(self._draft)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._said,
            start_new_session=True,  # Ctrl-C is ours: what was filmed until then is kept
        )

    def _write(self) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        assert self._last is not None
        picture, self._last = self._last, None
        try:
            self._process.stdin.write(np.ascontiguousarray(picture).data)
        except OSError as error:
            raise self._failed() from error

    def _failed(self) -> OutputError:
        self._said.seek(0)
        said = self._said.read().decode(errors="replace")
        return OutputError("The film cannot be encoded.", first_line(said) or "ffmpeg failed.")

    def _finish(self) -> None:
        """End the draft, make a GIF of it if it is to be one, and put it in its place."""
        assert self._process is not None
        assert self._process.stdin is not None
        if self._last is not None:
            self._write()
        try:
            self._process.stdin.close()
        except OSError as error:
            raise self._failed() from error
        if self._process.wait() or not self._draft.exists():
            raise self._failed()
        if self._format is _FORMATS[".gif"]:
            self._draft = self._gif(self._draft)
        data = self._draft.read_bytes()
        if self.path is not None:
            write_file(self.path, data)
        self.clip = Clip.of(data, self._format.media_type, self._still(), self.frames, self._rate)

    def _gif(self, draft: Path) -> Path:
        """The draft as a GIF with one palette, made for all of its frames."""
        palette, gif = draft.with_name("palette.png"), draft.with_name("draft.gif")
        use = "paletteuse=dither=none:diff_mode=rectangle"
        last = ("-loop", "0", "-final_delay", str(_LAST_FRAME_CS))
        self._run("-i", draft, "-vf", "palettegen", palette)
        self._run("-i", draft, "-i", palette, "-lavfi", use, *last, gif)
        return gif

    def _run(self, *words: str | Path) -> None:
        self._process = subprocess.Popen(
            [*self._ffmpeg, *map(str, words)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._said,
            start_new_session=True,
        )
        if self._process.wait():
            raise self._failed()

    def _still(self) -> Picture:
        """A picture from the middle: of those whose number is a power of two, one that is there."""
        return next(
            (still for number, still in reversed(self._stills) if 3 * number <= 2 * self.frames),
            self._stills[0][1],
        )


def _ffmpeg_with(encoder: str, suffix: str) -> list[str]:
    """The command of an ffmpeg that has this encoder.

    Raises:
        MissingExtraError: there is no ffmpeg.
        OutputError: it has no such encoder.
    """
    try:
        import imageio_ffmpeg
        import PIL  # noqa: F401

        program = imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        raise MissingExtraError("A film", "video") from error
    if encoder not in _encoders(program):
        raise OutputError(
            f"A film that ends with {suffix} cannot be encoded: {program} has no {encoder}.",
            "Choose another suffix, or unset IMAGEIO_FFMPEG_EXE.",
        )
    return [program, "-v", "error", "-nostdin", "-y"]


@lru_cache
def _encoders(program: str) -> frozenset[str]:
    """The names of the encoders of an ffmpeg; none where it does not run."""
    words = [program, "-hide_banner", "-encoders"]
    try:
        listed = subprocess.run(words, capture_output=True, check=True, stdin=subprocess.DEVNULL)
    except (OSError, subprocess.SubprocessError):
        return frozenset()
    lines = (line.split() for line in listed.stdout.decode(errors="replace").splitlines())
    return frozenset(words[1] for words in lines if len(words) > 1)
