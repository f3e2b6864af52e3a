"""Error messages: hints for outdated syntax, and a bound on their length."""

from __future__ import annotations

import re

from qcompile.terminal import visible

LONGEST_MESSAGE = 400
_LONGEST_NAME = 120

_NAME = r"[^\W\d]\w*"

HINTS = tuple(
    (re.compile(pattern, re.DOTALL), hint)
    for pattern, hint in (
        (
            r"(?:qubit|qreg)\s*(?:\[[^;\]]*\])?\s*(\$\d+)\s*;",
            r"Remove the line: \1 is always available.",
        ),
        (rf"(qubit|bit)\s+({_NAME})\s*(\[[^;\]]*\])\s*;", r"Write: \1\3 \2;"),
        (
            rf"(int|uint|float|angle|bit)\s+({_NAME})\s*(\[[^;\]]*\])\s*=\s*([^;]+);",
            r"Write: \1\3 \2 = \4;",
        ),
        (rf"const\s+({_NAME})\s*=\s*([^;]+);", r"Write: const float \1 = \2;"),
    )
)
"""Patterns of statements from drafts of OpenQASM 3, and what to write instead."""


def bounded(name: str, line: int | None, message: str) -> str:
    """`message` after the file name and line, in at most LONGEST_MESSAGE characters.

    It is made `visible`, because it may quote the file.
    """
    if len(name) > _LONGEST_NAME:
        name = f"...{name[-_LONGEST_NAME:]}"
    text = f"{name}: {message}" if line is None else f"{name}:{line}: {message}"
    text = visible(text)
    return text if len(text) <= LONGEST_MESSAGE else f"{text[: LONGEST_MESSAGE - 3]}..."
