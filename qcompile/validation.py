"""Words for what is wrong with a file."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from reprlib import Repr
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, FailFast, Field, ValidationError

from qcompile.limits import MAX_QUBITS

T = TypeVar("T")


class FirstFault(FailFast):
    """Of a list only the first fault is told; hashable, as types in a union must be."""

    def __hash__(self) -> int:
        return hash(self.fail_fast)


Many = Annotated[tuple[T, ...], FirstFault(), Field(max_length=MAX_QUBITS)]
"""As many as a device has qubits; of the entries that are wrong the first is told."""


class Record(BaseModel):
    """What a file of ours holds: it does not change, and unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


_MAX_LETTERS = 320
"""Of all faults together: what is longer is not read."""


class _JsonRepr(Repr):
    """Values as a JSON file has them."""

    def repr_NoneType(self, value: None, level: int) -> str:  # noqa: N802
        return "null"

    def repr_bool(self, value: bool, level: int) -> str:
        return "true" if value else "false"


_TAG = re.compile("<[a-z]+>")
"""How a member of a union is tagged: no word of the file."""

_SHORT = _JsonRepr()
_SHORT.maxlevel = 3
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = 60

Finite = Annotated[float, Field(allow_inf_nan=False)]
Line = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]+$", max_length=500)]
"""A text of one line that a terminal can show as it stands."""


def listed(words: Sequence[str], most: int = 8) -> str:
    """The first `most` words, and how many more there are."""
    more = [f"{len(words) - most} more"] * (len(words) > most)
    return ", ".join([*words[:most], *more])


def explain(error: Exception, most: int = 4, words: Mapping[str, str] | None = None) -> list[str]:
    """One line for each of the first `most` faults that pydantic or the file system names.

    `words` has what is said of faults of a type, by pydantic's name of it, in place of its own.
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
        place = _cut(place if place.isprintable() else ascii(place))  # keys are the file's own
        said = (words or {}).get(fault["type"], fault["msg"])
        said = said.removeprefix("Value error, ")  # these words are our own
        said = _cut(said.replace("Tuple", "List").replace(" after validation", ""), 120)
        line = f"{place}: {said[0].lower()}{said[1:]} (found {_found(fault['input'])})"
        if lines and len("".join(lines)) + len(line) > _MAX_LETTERS:
            break
        lines.append(line)
    if len(faults) > len(lines):
        lines.append(f"and {len(faults) - len(lines):,} more.")
    return lines


def _found(value: object) -> str:
    """A value of a file in a line, however large it is."""
    return _cut(" ".join(_SHORT.repr(value).split()))


def _cut(words: str, most: int = 60) -> str:
    return words if len(words) <= most else f"{words[: most - 3]}..."
