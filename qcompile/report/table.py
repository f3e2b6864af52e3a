"""Tables for papers: Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import StringIO
from os import PathLike
from pathlib import Path

from qcompile.characters import for_markup
from qcompile.errors import FigureError
from qcompile.notebook import html_paragraphs, html_table, text_table
from qcompile.output import checked_path, write_file

SUFFIXES = (".md", ".csv", ".tex")
INTERVAL_NAME = "95 % interval"
"""The column beside which a paper's table needs no standard deviation."""

_SPREAD = " ± "
_NUMBER = re.compile(r"(?<![\w.])([+-]?\d[\d,]*(?:\.\d+)?)(?:e([+-]?\d+))?(?!\w)")
_GREEK = "αβγδεζηθικλμνξπρστυφχψω"
_GREEK_NAMES = (
    *("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa"),
    *("lambda", "mu", "nu", "xi", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi"),
    "omega",
)
_LATEX = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",  # \textquotedbl is not in LaTeX's first encoding
    "±": r"$\pm$",
    "−": "$-$",
    **{letter: f"$\\{name}$" for letter, name in zip(_GREEK, _GREEK_NAMES, strict=True)},
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

    @classmethod
    def of(cls, value: str | float | None, form: str = "") -> Cell:
        """A value as `form` shows it; None is a dash, and nothing in CSV."""
        return cls("-" if value is None else format(value, form), (value,))


@dataclass(frozen=True)
class Table:
    """Rows of cells below columns: printed, shown by notebooks, or saved by suffix.

    `notes` are what a reader must know of the rows. CSV has columns alone.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell | str]]
    title: str = ""
    notes: Sequence[str] = ()

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
        below = [f"\n{_markdown(text)}" for text in (table.title, *table.notes) if text]
        return "\n".join([head, f"| {' | '.join(marks)} |", *body, *below, ""])

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
        head, *body = [_latex_row(line) for line in [table.header, *table.words]]
        comments = (for_markup(" ".join(text.split())) for text in (table.title, *table.notes))
        return "\n".join(
            [
                "% needs \\usepackage{booktabs}",
                *(f"% {words}" for words in comments if words),
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
            FigureError: the file has another ending, or the table has no rows.
            OptionError: the path is neither a name nor a path.
            OutputError: the file cannot be written.
        """
        file = checked_path(path)
        check_table_path(file)
        if not self.rows:
            raise FigureError(f"The table has no rows: {file} was not written.")
        forms = {".md": self.markdown, ".csv": self.csv, ".tex": self.latex}
        write_file(file, forms[file.suffix]().encode(errors="replace"))

    def __str__(self) -> str:
        return "\n".join([text_table(self.header, self.words), *self.notes])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        table = html_table(self.header, self.words, self.title)
        return table + html_paragraphs(self.notes)


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


def _latex_row(cells: Sequence[str]) -> str:
    """A row; what precedes it would take a star or a bracket at its beginning for its own."""
    row = f"{' & '.join(map(latex_text, cells))} \\\\"
    return f"{{}}{row}" if row.lstrip().startswith(("*", "[")) else row


def _escaped(text: str) -> str:
    return "".join(_LATEX.get(letter, letter) for letter in _one_line(text))


def _markdown(text: str) -> str:
    return _MARKDOWN.sub(r"\\\1", _one_line(text))


def _one_line(text: str) -> str:
    return for_markup(" ".join(text.split("\n")))
