"""Safe terminal output: text from files and services cannot move the cursor or hide anything."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

_CONTROL = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f"  # control characters except tab and line feed
    r"\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # bidirectional marks
    r"\u200b\u2028\u2029\u2060-\u2064\ufeff\U000e0000-\U000e007f]"  # invisible characters
)
_SEQUENCE = re.compile(r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)")


def plain(text: str) -> str:
    """The text without control characters (except line feed and tab) and invisible marks.

    Of an escape sequence only the escape is removed: its letters stay, so no nearby text is lost.
    """
    return _CONTROL.sub("", text)


def one_line(text: str, most: int = 300) -> str:
    """Text from a file or a service as one line of at most `most` characters."""
    line = plain(" ".join(_SEQUENCE.sub("", text).split()))
    return line if len(line) <= most else f"{line[: most - 3]}..."


def first_line(text: str, most: int = 200) -> str:
    """The first line of a package's message, at most `most` characters; "" if it is empty."""
    return one_line(text.strip().partition("\n")[0], most)


def visible(text: str) -> str:
    """The text with each unprintable character replaced by "?"; line feeds stay."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)


class PlainStream:
    """A text stream that writes `plain` text; everything else is passed on to the stream.

    It has no `buffer`, because bytes would bypass it. rich writes to `rich_proxied_file`, since its
    colours are escape sequences; `report.console` makes the text it prints plain.
    """

    def __init__(self, stream: TextIO):
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        return self.rich_proxied_file.write(plain(text))

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        if name == "buffer":
            raise AttributeError(name)
        return getattr(self.rich_proxied_file, name)


@contextmanager
def plain_output() -> Iterator[None]:
    """Makes standard output and standard error `plain` within the block."""
    out, err = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (
        stream if stream is None else cast("TextIO", PlainStream(stream)) for stream in (out, err)
    )
    try:
        yield
    finally:
        sys.stdout, sys.stderr = out, err
