"""Text on the terminal: whatever a file or a service says, it moves no cursor and hides nothing."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

_CONTROL = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f"  # all control characters but tab and line feed
    r"\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # marks that turn the direction of writing
    r"\u200b\u2028\u2029\u2060-\u2064\ufeff\U000e0000-\U000e007f]"  # what is not seen
)
_SEQUENCE = re.compile(r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)")


def plain(text: str) -> str:
    """The text without control characters (line feed and tab stay), bidirectional and unseen marks.

    An escape sequence loses its escape alone: its letters stay, so that no text near it is lost.
    """
    return _CONTROL.sub("", text)


def one_line(text: str, most: int = 300) -> str:
    """A text of a file or a service as one line of at most `most` characters."""
    line = plain(" ".join(_SEQUENCE.sub("", text).split()))
    return line if len(line) <= most else f"{line[: most - 3]}..."


def first_line(text: str, most: int = 200) -> str:
    """The first line of what a package says, of at most `most` characters; "" where it has none."""
    return one_line(text.strip().partition("\n")[0], most)


def visible(text: str) -> str:
    """The text with a question mark for each character that is not printed; line feeds stay."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)


class PlainStream:
    """A text stream that writes `plain` text; all else is the stream's own.

    It has no `buffer`: bytes would pass it by. `rich_proxied_file` is where rich writes, whose
    colours are escape sequences; `report.console` keeps its text plain.
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
    """Standard output and standard error are plain within the block."""
    out, err = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (
        stream if stream is None else cast("TextIO", PlainStream(stream)) for stream in (out, err)
    )
    try:
        yield
    finally:
        sys.stdout, sys.stderr = out, err
