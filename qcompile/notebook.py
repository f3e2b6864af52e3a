"""Small tables as text and as HTML: what objects show of themselves, in Python and in notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

Rows = Sequence[Sequence[str]]

MAX_ROWS = 40
"""Longer tables show their beginning and their end."""


def count(number: int, noun: str) -> str:
    """1 circuit, 2 circuits."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def reward_digits(*rewards: float) -> int:
    """The decimals of rewards that stand together: two where all are below 10, else one."""
    return 2 if max(map(abs, rewards)) < 10 else 1


def reward_text(mean: float, deviation: float | None = None, sign: str = "") -> str:
    """Mean ± standard deviation of rewards; with the sign "+" the mean has one."""
    digits = reward_digits(mean)
    return f"{mean:{sign}.{digits}f}" + ("" if deviation is None else f" ± {deviation:.{digits}f}")


def shortened(text: str, most: int = 100) -> str:
    """The beginning of a text that is longer than `most` letters."""
    return text if len(text) <= most else f"{text[:most].rsplit(' ', 1)[0]} ..."


def shortened_rows(rows: Rows) -> Rows:
    """At most MAX_ROWS rows: of more of them the first, a row of dots and the last five."""
    if len(rows) <= MAX_ROWS:
        return rows
    return [*rows[: MAX_ROWS - 6], ["..."] * len(rows[0]), *rows[-5:]]


def text_table(columns: Sequence[str], rows: Rows) -> str:
    """A header and a line for each row, in columns."""
    lines = [columns, *shortened_rows(rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def html_table(columns: Sequence[str], rows: Rows, title: str = "") -> str:
    """The same as an HTML table, below a title."""
    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
        for row in shortened_rows(rows)
    )
    caption = f"<p>{escape(title)}</p>" if title else ""
    return f"{caption}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
