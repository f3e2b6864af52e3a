"""Films of episodes."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.errors import MissingExtraError, QcompileError
from qcompile.output import check_writable, write_file

_PACKAGES = {".mp4": ("imageio.v3", "imageio_ffmpeg"), ".gif": ("imageio.v3",)}
"""What a film needs, by the end of its name."""


def check_film(path: Path) -> None:
    """Raise, before anything is played, where a film cannot be written to `path`."""
    if path.suffix not in _PACKAGES:
        raise QcompileError(f"{path} is no film.", f"Its name ends with {' or '.join(_PACKAGES)}.")
    check_writable(path)
    try:
        for package in _PACKAGES[path.suffix]:
            import_module(package)
    except ImportError as error:
        raise MissingExtraError("A film", "video") from error


def write_film(path: Path, frames: list[NDArray[np.uint8]], frames_per_second: int = 50) -> None:
    """Write RGB frames (height, width, 3) to `path`, as .mp4 or .gif, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
    """
    import imageio.v3

    if path.suffix == ".gif":
        # A GIF keeps every second frame at half the size: it is meant for a page.
        shown = np.stack(frames[::2])[:, ::2, ::2]
        options: dict[str, Any] = {"duration": 2000 / frames_per_second, "loop": 0}
    else:
        shown = np.stack(frames)
        options = {"plugin": "FFMPEG", "fps": frames_per_second, "macro_block_size": 1}
    write_file(path, imageio.v3.imwrite("<bytes>", shown, extension=path.suffix, **options))
