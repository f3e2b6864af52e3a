"""Small tables as text and as HTML, for the reprs of objects in Python and in notebooks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

from qcompile.characters import for_markup

Rows = Sequence[Sequence[str]]

MAX_ROWS = 40
"""Longer tables are cut to their beginning and their end."""


_LEAST_REWARD, _LEAST_FIXED = 0.1, 1e-4
"""A smaller reward has more than two decimals, and one below that a power of ten."""


def count(number: int, noun: str) -> str:
    """1 circuit, 2 circuits."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def reward_form(*rewards: float) -> str:
    """The format of rewards shown together, by the greatest of them.

    It has one decimal from 10 on, two below, and more where these would be less than two digits.
    """
    greatest = max(map(abs, rewards))
    if greatest == 0 or greatest >= _LEAST_REWARD:
        return ".2f" if greatest < 10 else ".1f"
    return f".{1 - math.floor(math.log10(greatest))}f" if greatest >= _LEAST_FIXED else ".2e"


def reward_text(mean: float, deviation: float | None = None, sign: str = "") -> str:
    """Mean ± standard deviation of rewards; `sign` "+" puts a plus before a positive mean."""
    form = reward_form(mean, deviation or 0.0) if abs(mean) < _LEAST_REWARD else reward_form(mean)
    return f"{mean:{sign}{form}}" + ("" if deviation is None else f" ± {deviation:{form}}")


def shortened(text: str, most: int = 100) -> str:
    """`text`, cut after a word if it is longer than `most` characters."""
    return text if len(text) <= most else f"{text[:most].rsplit(' ', 1)[0]} ..."


def shortened_rows(rows: Rows) -> Rows:
    """At most MAX_ROWS rows: of a longer table the first, a row of dots and the last five."""
    if len(rows) <= MAX_ROWS:
        return rows
    return [*rows[: MAX_ROWS - 6], ["..."] * len(rows[0]), *rows[-5:]]


def text_table(columns: Sequence[str], rows: Rows) -> str:
    """A header and the rows, one a line, in aligned columns."""
    lines = [columns, *shortened_rows(rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def html_table(columns: Sequence[str], rows: Rows, title: str = "") -> str:
    """The same table in HTML, below a title."""
    head = "".join(f"<th>{html_text(name)}</th>" for name in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{html_text(cell)}</td>" for cell in row) + "</tr>"
        for row in shortened_rows(rows)
    )
    caption = html_paragraphs([title] if title else [])
    return f"{caption}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def html_text(text: str) -> str:
    """Text for HTML or SVG: escaped, of characters that these can hold."""
    return escape(for_markup(text))


def html_paragraphs(texts: Sequence[str]) -> str:
    return "".join(f"<p>{html_text(text)}</p>" for text in texts)
