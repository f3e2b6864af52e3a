"""Films of episodes."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.errors import EnvironmentStepError, MissingExtraError
from qcompile.output import check_writable, write_file

SUFFIXES = (".mp4", ".gif")
_GIF_EVERY, _GIF_SHRINK = 2, 2
"""A GIF keeps every second frame at half the size, for a page; thin lines become paler, not cut."""


class Film:
    """A film that is encoded while it is taken, and appears at `path` whole or not at all.

    Raises:
        OutputError: there can be no file at `path`; found before anything is filmed.
        MissingExtraError: the packages that encode are not installed.
    """

    def __init__(self, path: Path):
        check_writable(path)
        try:
            import imageio_ffmpeg  # noqa: F401
            from imageio import v2
        except ImportError as error:
            raise MissingExtraError("A film", "video") from error
        self._imageio, self._path = v2, path
        self._folder = TemporaryDirectory(prefix="qcompile-film-")
        self._draft = Path(self._folder.name) / f"film{path.suffix}"
        self._writer: Any = None
        self._shape: tuple[int, ...] | None = None
        self.frames = 0

    def __enter__(self) -> Film:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        try:
            if self._writer is not None:
                self._writer.close()
                if not self._draft.exists():  # Ctrl-C came within the first frame
                    self.frames = 0
                elif kind is None:
                    write_file(self._path, self._draft.read_bytes())
        finally:
            self._folder.cleanup()

    def add(self, frame: NDArray[np.uint8], frames_per_second: float) -> None:
        """Take one RGB frame (height, width, 3).

        Raises:
            EnvironmentStepError: its size is not that of the first one, which .mp4 does not allow.
        """
        gif = self._path.suffix == ".gif"
        self._shape = self._shape or frame.shape
        if not gif and frame.shape != self._shape:
            raise EnvironmentStepError(
                f"The frames of the film change their size: {self._shape[:2]}, then "
                f"{frame.shape[:2]}.",
                "Film it as a .gif, or run without --video.",
            )
        if self._writer is None:
            options: dict[str, Any] = (
                {"duration": 1000 * _GIF_EVERY / frames_per_second, "loop": 0}
                if gif
                else {"fps": frames_per_second, "macro_block_size": 1}
            )
            self._writer = self._imageio.get_writer(self._draft, **options)
        if not gif:
            height, width = (size - size % 2 for size in frame.shape[:2])  # H.264 takes even sizes
            self._writer.append_data(frame[:height, :width])
        elif self.frames % _GIF_EVERY == 0:
            self._writer.append_data(_shrunk(frame))
        self.frames += 1


def _shrunk(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A frame whose pixels are the means of squares; at odd edges the last row or column again."""
    height, width = (size + -size % _GIF_SHRINK for size in frame.shape[:2])
    padded = np.pad(
        frame, ((0, height - len(frame)), (0, width - frame.shape[1]), (0, 0)), mode="edge"
    )
    squares = padded.reshape(height // _GIF_SHRINK, _GIF_SHRINK, width // _GIF_SHRINK, -1, 3)
    means: NDArray[np.float64] = squares.mean(axis=(1, 3))
    return np.rint(means).astype(np.uint8)
