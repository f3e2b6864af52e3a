"""Blocks of a page that are typed along: commands after `$`, and what is printed below them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from golden_files import stable

DOCS = Path(__file__).parents[1] / "docs"
WIDTH = 80
"""Columns of a terminal whose lines fit a page."""

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_ANY = r"(?:.*\n)*?"


def blocks(page: str) -> list[tuple[str, str]]:
    """Language and text of each block of a page of docs/."""
    return _FENCE.findall((DOCS / page).read_text())


def typed(block: str) -> Iterator[tuple[str, str]]:
    """Each command of a block, and what is printed below it."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        line, _, answer = part.partition("\n")
        yield line, answer


def said(text: str, here: Path) -> str:
    """`text` without what changes from run to run, and no blank lines at its ends."""
    return stable(text, here).strip("\n") + "\n"


def matches(printed: str, answer: str) -> bool:
    """Whether `printed`, of a page, is what `answer` says; `...` on the page is any lines."""
    lines = printed.splitlines(keepends=True)
    pattern = "".join(_ANY if line == "...\n" else re.escape(line) for line in lines)
    return re.fullmatch(pattern, answer) is not None
