"""Films of episodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from qcompile.errors import MissingExtraError, OutputError, QcompileError

SUFFIXES = (".mp4", ".gif")


def check_film(path: Path) -> None:
    """Raise, before anything is played, where a film cannot be written to `path`."""
    if path.suffix not in SUFFIXES:
        raise QcompileError(f"{path} is no film.", f"Its name ends with {' or '.join(SUFFIXES)}.")
    if not path.parent.is_dir():
        raise OutputError(f"Cannot write {path}.", f"There is no folder {path.parent}.")
    try:
        import imageio.v3  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("A film", "video") from error


def write_film(path: Path, frames: list[NDArray[np.uint8]], frames_per_second: int = 50) -> None:
    """Write RGB frames (height, width, 3) to `path`, as .mp4 or .gif.

    Raises:
        OutputError: the file cannot be written.
    """
    import imageio.v3

    try:
        if path.suffix == ".gif":
            # A GIF keeps every second frame at half the size: it is meant for a page.
            small = np.stack(frames[::2])[:, ::2, ::2]
            imageio.v3.imwrite(path, small, duration=2000 / frames_per_second, loop=0)
        else:
            imageio.v3.imwrite(path, np.stack(frames), fps=frames_per_second, macro_block_size=1)
    except OSError as error:
        raise OutputError(f"Cannot write {path}.", str(error)) from error
