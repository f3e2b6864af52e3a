"""Splitting the text of a program file into statements."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

COMMENT = r"//[^\n]*+|/\*(?:[^*]|\*(?!/))*+\*/"
BLANK = re.compile(rf"(?:\s++|{COMMENT})*+")
"""White space and comments, of any length."""

_STOP = re.compile(rf"{COMMENT}|/\*|\"[^\"\n]*+\"|'[^'\n]*+'|[;{{}}]")
_WORD = re.compile(r"#?[^\W\d]\w*+|\S")
_ANNOTATION = re.compile(r"@[^\n]*+")
_LINE = re.compile(r"[^\n]*+")
_ELSE = re.compile(r"else\b")
_SET = re.compile(r"in\s*+\Z")
_WITH_BODY = frozenset(
    ["gate", "def", "for", "while", "if", "else", "switch", "box", "cal", "defcal", "{"]
)


class Span(NamedTuple):
    """A statement is text[start:end]; `word` is its first word after any annotations.

    `word` is "/*" if a comment begins there that does not end.
    """

    start: int
    end: int
    word: str


def spans(text: str, position: int = 0) -> Iterator[Span]:
    """The statements of OpenQASM text from `position` on, in order.

    A statement ends at its semicolon or at the end of its body; a pragma at the end of its line.
    """
    while True:
        position = BLANK.match(text, position).end()  # type: ignore[union-attr]
        if position == len(text):
            return
        span = _span(text, position)
        yield span
        position = span.end


def _span(text: str, start: int) -> Span:
    first = start
    while text.startswith("@", first):
        first = BLANK.match(text, _ANNOTATION.match(text, first).end()).end()  # type: ignore[union-attr]
    match = _WORD.match(text, first)
    word = match[0] if match else ""
    if word.lstrip("#") == "pragma":
        return Span(start, _LINE.match(text, first).end(), word)  # type: ignore[union-attr]
    end = _end(text, first, word)
    return Span(start, len(text), "/*") if end is None else Span(start, end, word)


def _end(text: str, start: int, word: str) -> int | None:
    """The end of the statement; None if a comment does not end."""
    has_body = word in _WITH_BODY
    depth, position = 0, start
    while stop := _STOP.search(text, position):
        mark, position = stop[0], stop.end()
        if mark == "/*":
            return None
        if mark == "{":
            if depth == 0 and word == "for" and _SET.search(text, start, stop.start()):
                position = _closing(text, position)
            else:
                depth += 1
        elif mark == "}":
            depth -= 1
        if depth <= 0 and (mark == ";" or (mark == "}" and (has_body or depth < 0))):
            following = BLANK.match(text, position).end()  # type: ignore[union-attr]
            if not (word == "if" and _ELSE.match(text, following)):
                return position
    return len(text)


def _closing(text: str, position: int) -> int:
    """The position after the brace that closes a set of values."""
    end = text.find("}", position)
    return len(text) if end < 0 else end + 1
