"""Pages that are typed along: commands after `$`, and what is printed below them.

A command goes on in the next line where its line ends with a backslash.

    QCOMPILE_GOLDEN=1 pytest tests/test_sessions.py tests/live/test_first_hardware_page.py

writes into the pages what is printed now, but where a page leaves lines out (`...`).
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from golden_files import REWRITES, stable

DOCS = Path(__file__).parents[1] / "docs"
WIDTH = 80
"""Columns of a terminal whose lines fit a page."""

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"(?:.*\\\n)*.*\n?")
_ANY = r"(?:.*\n)*?"


def blocks(page: str) -> list[tuple[str, str]]:
    """Language and text of each block of a page of docs/."""
    return _FENCE.findall((DOCS / page).read_text())


def typed(block: str) -> Iterator[tuple[str, str]]:
    """Each command of a block, and what is printed below it."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        found = _COMMAND.match(part)
        assert found is not None
        yield found[0].removesuffix("\n"), part[found.end() :]


def words_of(command: str) -> list[str]:
    """The words of a command, as a shell reads them."""
    return shlex.split(command.replace("\\\n", ""))


def matches(printed: str, answer: str) -> bool:
    """Whether `printed`, of a page, is what `answer` says; `...` on the page is any lines."""
    lines = printed.splitlines(keepends=True)
    pattern = "".join(_ANY if line == "...\n" else re.escape(line) for line in lines)
    return re.fullmatch(pattern, answer) is not None


class Transcript:
    """What a page prints beside what is printed now; `masked` compares no figures."""

    def __init__(self, page: str, here: Path, mask: Callable[[str], str] = str):
        self._page, self._here, self._mask = DOCS / page, here, mask
        self._wrong: list[str] = []

    def compare(self, line: str, printed: str, now: str) -> None:
        """Note it where `line` does not answer what the page prints."""
        if matches(self._said(printed), self._said(now)):
            return
        if not REWRITES or "...\n" in printed:
            self._wrong.append(f"$ {line}\n{now}")
            return
        page, plain = self._page.read_text(), now.replace(f"{self._here}/", "")
        plain = re.sub(r" +$", "", plain, flags=re.MULTILINE).strip("\n") + "\n"
        assert page.count(f"$ {line}\n{printed}") == 1
        self._page.write_text(page.replace(f"$ {line}\n{printed}", f"$ {line}\n{plain}"))

    def check(self) -> None:
        """Fail where anything was noted."""
        if self._wrong:
            pytest.fail("\n".join(self._wrong), pytrace=False)

    def _said(self, text: str) -> str:
        return self._mask(stable(text, self._here).strip("\n") + "\n")
