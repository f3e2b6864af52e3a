"""Readable messages for invalid files."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from reprlib import Repr
from typing import Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, FailFast, Field, ValidationError

from qcompile.characters import is_line
from qcompile.limits import MAX_QUBITS

T = TypeVar("T")


class FirstFault(FailFast):
    """Reports only the first fault of a list; hashable, as types in a union must be."""

    def __hash__(self) -> int:
        return hash(self.fail_fast)


Many = Annotated[tuple[T, ...], FirstFault(), Field(max_length=MAX_QUBITS)]
"""A list of at most MAX_QUBITS entries; only the first invalid entry is reported."""


class Record(BaseModel):
    """The contents of a qcompile file: immutable, and unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


_MAX_LETTERS = 320
"""The most characters of all reported faults together: nobody reads more."""


class _JsonRepr(Repr):
    """Shows values as they appear in a JSON file."""

    def repr_NoneType(self, value: None, level: int) -> str:  # noqa: N802
        return "null"

    def repr_bool(self, value: bool, level: int) -> str:
        return "true" if value else "false"


_TAG = re.compile("<[a-z]+>")
"""How pydantic tags a member of a union: not a key of the file."""

_SHORT = _JsonRepr()
_SHORT.maxlevel = 3
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = 60

Finite = Annotated[float, Field(allow_inf_nan=False)]
LINE = "one line of text, without control characters and noncharacters"
"""What `Line` is, for messages."""


def _line(text: str) -> str:
    if not is_line(text):
        raise ValueError(f"must be {LINE}")
    return text


Line = Annotated[str, Field(max_length=500), AfterValidator(_line)]
"""One line of text that a terminal can print and every file can hold."""


def listed(words: Sequence[str], most: int = 8) -> str:
    """The first `most` words, and the number of those left out."""
    more = [f"{len(words) - most} more"] * (len(words) > most)
    return ", ".join([*words[:most], *more])


def explain(error: Exception, most: int = 4, words: Mapping[str, str] | None = None) -> list[str]:
    """One line for each of the first `most` faults reported by pydantic or the file system.

    `words` replaces pydantic's message for some types of fault; its keys are pydantic's type names.
    """
    if isinstance(error, OSError) and error.errno is not None:
        return [os.strerror(error.errno)]
    if isinstance(error, UnicodeDecodeError):
        return ["It is not UTF-8 text."]
    if not isinstance(error, ValidationError):
        return [str(error)]
    faults = error.errors(include_url=False, include_context=False)
    lines: list[str] = []
    for fault in faults[:most]:
        parts = [str(part) for part in fault["loc"]]
        place = ".".join(part for part in parts if not _TAG.fullmatch(part)) or "the file"
        place = _cut(place if place.isprintable() else ascii(place))  # keys come from the file
        message = (words or {}).get(fault["type"], fault["msg"])
        message = message.removeprefix("Value error, ")  # pydantic puts this before our messages
        message = _cut(message.replace("Tuple", "List").replace(" after validation", ""), 120)
        line = f"{place}: {message[0].lower()}{message[1:]} (found {_short(fault['input'])})"
        if lines and len("".join(lines)) + len(line) > _MAX_LETTERS:
            break
        lines.append(line)
    if len(faults) > len(lines):
        lines.append(f"and {len(faults) - len(lines):,} more.")
    return lines


def _short(value: object) -> str:
    """A value of a file on one line, shortened if it is large."""
    return _cut(" ".join(_SHORT.repr(value).split()))


def _cut(words: str, most: int = 60) -> str:
    return words if len(words) <= most else f"{words[: most - 3]}..."
