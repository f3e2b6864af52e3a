"""Words for what is wrong with a file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

Line = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]+$", max_length=500)]
"""A text of one line that a terminal can show as it stands."""


def read_file(path: Path) -> bytes:
    """The contents of a regular file: a pipe may never end, and a device has no end.

    Raises:
        OSError: it is none, or it cannot be read.
    """
    if path.exists() and not path.is_file():
        raise OSError("it is no regular file")
    return path.read_bytes()


def listed(words: Sequence[str], most: int = 8) -> str:
    """The first `most` words, and how many more there are."""
    more = [f"{len(words) - most} more"] * (len(words) > most)
    return ", ".join([*words[:most], *more])


def explain(error: Exception, most: int = 4) -> list[str]:
    """One line for each of the first `most` faults that pydantic or the file system names."""
    if isinstance(error, OSError) and error.errno is not None:
        return [os.strerror(error.errno)]
    if not isinstance(error, ValidationError):
        return [str(error)]
    faults = error.errors(include_url=False, include_context=False)
    lines = []
    for fault in faults[:most]:
        place = ".".join(map(str, fault["loc"])) or "the file"
        place = place if place.isprintable() else ascii(place)  # keys are the file's own
        found = repr(fault["input"])
        found = found if len(found) <= 60 else f"{found[:57]}..."
        said = fault["msg"].removeprefix("Value error, ")  # these words are our own
        lines.append(f"{place}: {said[0].lower()}{said[1:]} (found {found})")
    if len(faults) > most:
        lines.append(f"and {len(faults) - most} more.")
    return lines
