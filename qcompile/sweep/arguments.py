"""What the arguments of verbs, studies and evaluations have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any

Name = str | PathLike[str]
"""A bare name or a path."""
Words = Callable[[str], None]
"""What is told something that a person should read."""


def several(values: Any) -> list[Any]:
    """The values, or the one value, in a list."""
    return [*values] if isinstance(values, Sequence) and not isinstance(values, str) else [values]


def ignore(words: str) -> None:
    """Nobody wants to know."""


def no_progress(finished: int, count: int, words: str) -> None:
    """Nobody looks on."""
