"""Small tables as text and as HTML, for the reprs of objects in Python and in notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

Rows = Sequence[Sequence[str]]

MAX_ROWS = 40
"""Longer tables are cut to their beginning and their end."""


def count(number: int, noun: str) -> str:
    """1 circuit, 2 circuits."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def reward_digits(*rewards: float) -> int:
    """The number of decimals for rewards shown together: two if all are below 10, else one."""
    return 2 if max(map(abs, rewards)) < 10 else 1


def reward_text(mean: float, deviation: float | None = None, sign: str = "") -> str:
    """Mean ± standard deviation of rewards; `sign` "+" puts a plus before a positive mean."""
    digits = reward_digits(mean)
    return f"{mean:{sign}.{digits}f}" + ("" if deviation is None else f" ± {deviation:.{digits}f}")


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
    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
        for row in shortened_rows(rows)
    )
    caption = f"<p>{escape(title)}</p>" if title else ""
    return f"{caption}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
