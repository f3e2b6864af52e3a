"""Tables for papers: Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import StringIO
from os import PathLike
from pathlib import Path

from qcompile.errors import FigureError
from qcompile.notebook import html_table, text_table
from qcompile.output import write_file

SUFFIXES = (".md", ".csv", ".tex")
INTERVAL_NAME = "95 % interval"
"""The column beside which a paper's table needs no standard deviation."""

_SPREAD = " ± "
_NUMBER = re.compile(r"(?<![\w.])([+-]?\d[\d,]*(?:\.\d+)?)(?:e([+-]?\d+))?(?!\w)")
_LATEX = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "±": r"$\pm$",
    "−": "$-$",
    "θ": r"$\theta$",
    **{letter: f"\\{letter}" for letter in "&%$#_"},
}
_MARKDOWN = re.compile(r"([\\`*_<>|\[\]])")


def check_table_path(path: Path) -> None:
    """Nothing, if a table can be saved under such a name.

    Raises:
        FigureError: it has another ending.
    """
    if path.suffix not in SUFFIXES:
        raise FigureError(f"{path} must end with .md, .csv or .tex.")


@dataclass(frozen=True)
class Column:
    """A column: its name, the unit of its numbers, and the names of a cell's several `parts`.

    A `setting` is what rows were made with, not a result.
    """

    name: str
    unit: str = ""
    parts: tuple[str, ...] = ()
    right: bool = True
    setting: bool = False

    @property
    def header(self) -> str:
        return f"{self.name}, {self.unit}" if self.unit else self.name

    @property
    def headers(self) -> tuple[str, ...]:
        """The headers of its parts, or its own."""
        unit = f", {self.unit}" if self.unit else ""
        return tuple(part + unit for part in self.parts) or (self.header,)


@dataclass(frozen=True)
class Cell:
    """What is shown, such as 12.3 ± 4.5, and the `values` that a program reads: one or several.

    `implied_by` names what leaves no choice: exact expectations on ideal, for instance.
    """

    words: str
    values: tuple[str | float | None, ...]
    implied_by: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of cells below columns: printed, shown by notebooks, or saved by suffix."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell | str]]
    title: str = ""

    @classmethod
    def of_words(
        cls, columns: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[str] = ()
    ) -> Table:
        """A table of words as they are shown; the columns `left` are not of numbers."""
        return cls([Column(name, right=name not in left) for name in columns], rows)

    @property
    def header(self) -> list[str]:
        return [column.header for column in self.columns]

    @property
    def words(self) -> list[list[str]]:
        """What the cells show, row by row."""
        return [[_words(cell) for cell in row] for row in self.rows]

    def for_paper(self) -> Table:
        """The table in fewer columns, as LaTeX and Markdown show it.

        Settings that are the same in all rows move to the title; columns of dashes and standard
        deviations beside a 95 % interval go.
        """
        said, kept = [self.title] * bool(self.title), []
        for index, column in enumerate(self.columns):
            cells = [row[index] for row in self.rows]
            if cells and all(_words(cell) == "-" for cell in cells):
                continue
            if column.setting and (words := _only_value(column, cells)):
                said.append(words)
            else:
                kept.append(index)
        has_interval = any(
            self.columns[index].name == INTERVAL_NAME
            and all(_words(row[index]) != "-" for row in self.rows)
            for index in kept
        )
        cut = {index for index in kept if has_interval and _SPREAD in self.columns[index].name}
        names = {index: self.columns[index].name.split(_SPREAD)[0] for index in cut}
        return replace(
            self,
            columns=[
                replace(self.columns[index], name=names.get(index, self.columns[index].name))
                for index in kept
            ],
            rows=[
                [_words(row[k]).split(_SPREAD)[0] if k in cut else row[k] for k in kept]
                for row in self.rows
            ],
            title=", ".join(said),
        )

    def markdown(self) -> str:
        """A table of Markdown, as GitHub and documentation builders read it."""
        table = self.for_paper()
        marks = ["---:" if column.right else "---" for column in table.columns]
        lines = [table.header, *table.words]
        head, *body = [f"| {' | '.join(map(_markdown, line))} |" for line in lines]
        title = [f"\n{_markdown(table.title)}"] * bool(table.title)
        return "\n".join([head, f"| {' | '.join(marks)} |", *body, *title, ""])

    def csv(self) -> str:
        """Comma-separated values: a column for each number, none of them rounded."""
        stream = StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([header for column in self.columns for header in column.headers])
        for row in self.rows:
            writer.writerow(
                [
                    "" if value is None else value
                    for cell in row
                    for value in ((cell,) if isinstance(cell, str) else cell.values)
                ]
            )
        return stream.getvalue()

    def latex(self) -> str:
        r"""A tabular of LaTeX with the rules of booktabs, to be read by \input."""
        table = self.for_paper()
        form = "".join("r" if column.right else "l" for column in table.columns)
        head, *body = [
            f"{' & '.join(map(latex_text, line))} \\\\" for line in [table.header, *table.words]
        ]
        title = " ".join(table.title.split())
        return "\n".join(
            [
                "% needs \\usepackage{booktabs}",
                *([f"% {title}"] if title else []),
                f"\\begin{{tabular}}{{{form}}}",
                "\\toprule",
                head,
                "\\midrule",
                *body,
                "\\bottomrule",
                "\\end{tabular}",
                "",
            ]
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the table to a .md, .csv or .tex file, which is overwritten.

        Raises:
            FigureError: the file has another ending.
            OutputError: the file cannot be written.
        """
        file = Path(path)
        check_table_path(file)
        forms = {".md": self.markdown, ".csv": self.csv, ".tex": self.latex}
        write_file(file, forms[file.suffix]().encode())

    def __str__(self) -> str:
        return text_table(self.header, self.words)

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return html_table(self.header, self.words, self.title)


def _words(cell: Cell | str) -> str:
    return cell if isinstance(cell, str) else cell.words


def _only_value(column: Column, cells: Sequence[Cell | str]) -> str:
    """The setting that all cells share but those that are implied; empty where they differ."""
    implied = {c.implied_by: c.words for c in cells if isinstance(c, Cell) and c.implied_by}
    chosen = [c for c in cells if isinstance(c, str) or not c.implied_by] or cells
    values = {_words(cell) for cell in chosen}
    if len(chosen) < 2 or len(values) > 1:
        return ""
    value = values.pop()
    others = "".join(f" ({by}: {words})" for by, words in implied.items() if words != value)
    return f"{column.header} {value}{others}"


def latex_text(text: str) -> str:
    """Text for LaTeX: its special characters escaped, its signed numbers in math mode."""
    parts, end = [], 0
    for found in _NUMBER.finditer(text):
        number, power = found.groups()
        if number[0] not in "+-" and power is None:
            continue
        digits = number.replace(",", "{,}")
        math = digits if power is None else f"{digits} \\times 10^{{{int(power)}}}"
        parts += [_escaped(text[end : found.start()]), f"${math}$"]
        end = found.end()
    return "".join([*parts, _escaped(text[end:])])


def _escaped(text: str) -> str:
    return "".join(_LATEX.get(letter, letter) for letter in " ".join(text.split("\n")))


def _markdown(text: str) -> str:
    return _MARKDOWN.sub(r"\\\1", " ".join(text.split("\n")))
