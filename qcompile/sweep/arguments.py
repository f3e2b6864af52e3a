"""What the arguments of both faces have in common."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Any

import numpy as np

Name = str | PathLike[str]
"""A bare name or a path."""


def is_several(values: Any) -> bool:
    """Whether `values` are several in an order: a sequence, an iterator or an array, no text."""
    if isinstance(values, np.ndarray):
        return values.ndim == 1
    return isinstance(values, Sequence | Iterator) and not isinstance(values, str | bytes)


def several(values: Any) -> list[Any]:
    """The values, or the one value, in a list; those of an array as Python's numbers."""
    if not is_several(values):
        return [values]
    return values.tolist() if isinstance(values, np.ndarray) else [*values]


def ignore(words: str) -> None:
    """Nobody wants to know."""


def no_progress(finished: int, count: int, words: str) -> None:
    """Nobody looks on."""
