"""The paper's training study: its rows, and what the paper says of each (arXiv 2203.14348)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from qcompile.errors import StudyError
from qcompile.sweep.study.rows import Row
from qcompile.sweep.study.rows_file import Figure, RowsFile, read_rows


@cache
def _file() -> RowsFile:
    return read_rows(Path(__file__).with_name("paper.toml"))


def figures() -> dict[str, Figure]:
    """Every figure of the study, by name."""
    return _file().figures


def rows() -> list[Row]:
    """Every row of the study."""
    return [*_file().rows]


def belongs(row: Row, figure: str) -> bool:
    """Whether a figure shows a row: the SVQC of the paper is also a row of `reuse`."""
    return row.figure == figure or row.name in figures()[figure].also


def rows_of(names: tuple[str, ...]) -> list[Row]:
    """The rows of these figures, or all.

    Raises:
        StudyError: there is no such figure.
    """
    known = figures()
    for name in names:
        if name not in known:
            raise StudyError(f"Unknown figure {name!r}.", f"Known: {', '.join(known)}.")
    return [row for row in rows() if any(belongs(row, name) for name in names or known)]


def shortened(row: Row, episodes: int) -> Row:
    """The row with at most so many episodes, for a first look."""
    fewest = min(episodes, row.settings.episodes or episodes)
    return replace(row, settings=row.settings.changed(episodes=fewest))
