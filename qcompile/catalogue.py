"""Where devices and policies are found: by path, or by bare name in hardware/ and trained/."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

Shelf = Literal["hardware", "trained"]

_PACKAGE = Path(__file__).parent


def shelves(shelf: Shelf) -> list[Path]:
    """The folders searched, in order: the working folder's own, the one shipped with qcompile.

    The wheel carries hardware/ and trained/ inside the package; a checkout has them beside it.
    """
    shipped = _PACKAGE / shelf
    if not shipped.is_dir():
        shipped = _PACKAGE.parent / shelf
    return [Path.cwd() / shelf, shipped]


def find(shelf: Shelf, name: str, suffixes: Sequence[str]) -> Path | None:
    """The file that `name` stands for, a path or a bare name, or None."""
    if Path(name).is_file():
        return Path(name)
    if Path(name).name == name:
        for folder in shelves(shelf):
            for suffix in ("", *suffixes):
                path = folder / f"{name}{suffix}"
                if path.suffix in suffixes and path.is_file():
                    return path
    return None


def names(shelf: Shelf, suffixes: Sequence[str]) -> list[str]:
    """Every bare name on the shelf, sorted."""
    found = {
        path.stem
        for folder in shelves(shelf)
        for suffix in suffixes
        for path in folder.glob(f"*{suffix}")
    }
    return sorted(found)


def nearest(name: str, known: Sequence[str]) -> str:
    """A line of advice: the known names nearest to `name`, or all of them."""
    close = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    return f"Did you mean {' or '.join(close)}?" if close else f"Known: {', '.join(known)}."
