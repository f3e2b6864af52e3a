"""Finding devices and policies: by path, or by bare name in hardware/ and trained/."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

Shelf = Literal["hardware", "trained"]

_MAX_LETTERS = 100
"""Longer words are cut off here: they match nothing and are slow to compare."""

_PACKAGE = Path(__file__).parent


def shelves(shelf: Shelf) -> list[Path]:
    """The folders to search, in order: that of the working folder, then that of qcompile.

    The wheel carries hardware/ and trained/ inside the package; a checkout has them beside it.
    """
    shipped = _PACKAGE / shelf
    if not shipped.is_dir():
        shipped = _PACKAGE.parent / shelf
    return [Path(shelf), shipped]


def find(shelf: Shelf, name: str, suffixes: Sequence[str]) -> Path | None:
    """The file that `name`, a path or a bare name, refers to; None if there is none.

    The path may be that of a pipe or a device, or of a folder with one of the suffixes: the reader
    of the file refuses those.
    """
    # Unlike the methods of Path, these return False for a name that is too long for a path.
    if os.path.lexists(name) and (Path(name).suffix in suffixes or not os.path.isdir(name)):
        return Path(name)
    if Path(name).name == name:
        for folder in shelves(shelf):
            for suffix in ("", *suffixes):
                path = folder / f"{name}{suffix}"
                if path.suffix in suffixes and os.path.isfile(path):
                    return path
    return None


def names(shelf: Shelf, suffixes: Sequence[str]) -> list[str]:
    """Every bare name on the shelf, sorted."""
    stems = {
        path.stem
        for folder in shelves(shelf)
        for suffix in suffixes
        for path in folder.glob(f"*{suffix}")
        if path.is_file()
    }
    return sorted(stems)


def nearest(name: str, known: Iterable[str], most: int = 12) -> str:
    """A hint: the known names closest to `name`, or the first `most` of them."""
    words = list(dict.fromkeys(known))
    if close := close_names(name, words):
        return f"Did you mean {' or '.join(close)}?"
    if not words:
        return "None is known."
    return f"Known: {', '.join([*words[:most], *(['...'] if len(words) > most else [])])}."


def close_names(name: str, known: Iterable[str]) -> list[str]:
    """The known names that `name` may be a misspelling of, the closest ones only.

    Ignoring case, they share at least two thirds of their letters with it, in the same order.
    """
    spelled: dict[str, list[str]] = {}
    for word in dict.fromkeys(known):
        spelled.setdefault(word.casefold(), []).append(word)
    folded = name.casefold()[:_MAX_LETTERS]
    close = difflib.get_close_matches(folded, spelled, n=3, cutoff=2 / 3)
    likeness = [difflib.SequenceMatcher(None, low, folded).ratio() for low in close]
    close = [low for low, ratio in zip(close, likeness, strict=True) if ratio > likeness[0] - 0.08]
    return [word for low in close for word in spelled[low]]
