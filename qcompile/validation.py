"""Words for what is wrong with a file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, ValidationError

Line = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f-\x9f]+$", max_length=500)]
"""A text of one line that a terminal can show as it stands."""


def explain(error: Exception, most: int = 4) -> list[str]:
    """One line for each of the first `most` faults that pydantic or the file system names."""
    if not isinstance(error, ValidationError):
        return [str(error)]
    faults = error.errors(include_url=False, include_context=False)
    lines = []
    for fault in faults[:most]:
        place = ".".join(map(str, fault["loc"])) or "the file"
        place = place if place.isprintable() else ascii(place)  # keys are the file's own
        found = repr(fault["input"])
        found = found if len(found) <= 60 else f"{found[:57]}..."
        lines.append(f"{place}: {fault['msg'][0].lower()}{fault['msg'][1:]} (found {found})")
    if len(faults) > most:
        lines.append(f"and {len(faults) - most} more.")
    return lines
