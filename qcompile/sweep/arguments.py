"""Types and helpers for the arguments of verbs, studies and evaluations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from numbers import Integral
from os import PathLike
from typing import Any, Literal

import numpy as np

from qcompile.caller import option
from qcompile.errors import OptionError

Name = str | PathLike[str]
"""A bare name or a path."""
Words = Callable[[str], None]
"""A function that is called with a message for the user."""


@dataclass(frozen=True, repr=False)
class Planned:
    """The default of a setting: `offline`, or with `live` the value that a plan chooses."""

    offline: Any

    def __repr__(self) -> str:
        return f"{self.offline!r} (live: planned)"


Shots = int | None | Literal["exact"]
"""A number of shots; None or "exact" are expectations without shot noise."""


def is_several(values: Any) -> bool:
    """Whether `values` is a sequence, an iterator or a 1-D array, but not a string."""
    if isinstance(values, np.ndarray):
        return values.ndim == 1
    return isinstance(values, Sequence | Iterator) and not isinstance(values, str | bytes)


def several(values: Any) -> list[Any]:
    """The values, or the single value, as a list; those of an array as Python numbers."""
    if not is_several(values):
        return [values]
    return values.tolist() if isinstance(values, np.ndarray) else [*values]


def shots_of(shots: Shots) -> int | None:
    """The number of shots, None for exact expectations.

    Raises:
        OptionError: `shots` is neither a number nor "exact" nor None.
    """
    if shots is None or shots == "exact":
        return None
    if isinstance(shots, bool) or not isinstance(shots, Integral):
        raise OptionError(f'{option("shots")} {shots!r} is not a whole number, "exact" or None.')
    return int(shots)


def ignore(words: str) -> None:
    """Ignore a message."""


def no_progress(finished: int, count: int, words: str) -> None:
    """Ignore the progress."""
