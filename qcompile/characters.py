"""Characters that names and markup cannot hold: refused on the way in, replaced on the way out."""

from __future__ import annotations

import re

_CONTROLS = r"\x00-\x1f\x7f-\x9f"
_SURROGATES = r"\ud800-\udfff"
_NONCHARACTERS = r"\ufdd0-\ufdef" + "".join(
    rf"\U{plane:04x}fffe\U{plane:04x}ffff" for plane in range(17)
)
_UNFIT = re.compile(f"[{_CONTROLS}{_SURROGATES}{_NONCHARACTERS}]")
_NO_MARKUP = re.compile(rf"(?![\t\n\r])[{_CONTROLS}{_SURROGATES}{_NONCHARACTERS}]")
_DIRECTIONS = re.compile("[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def is_line(text: str) -> bool:
    """Whether a text is one line that is not empty, of characters that every file can hold.

    Controls, surrogates and noncharacters are not such characters.
    """
    return bool(text) and not _UNFIT.search(text)


def for_markup(text: str) -> str:
    """The text as SVG, HTML and their like can hold it; it is not escaped.

    U+FFFD replaces what XML forbids. Marks of direction are removed: they would turn what stands
    beside the text.
    """
    return _DIRECTIONS.sub("", _NO_MARKUP.sub("\N{REPLACEMENT CHARACTER}", text))
