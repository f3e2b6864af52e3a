"""What a report says, before it is laid out: a headline, and sections of blocks.

Every text is plain; `render` escapes it, and makes figures and films parts of the page.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle

STYLE = Path(__file__).with_name("page.mplstyle")
_NUMBER = re.compile(
    r"[-+−±]?[\d.,]+(e[-+]?\d+)?( ?%| s)?( ?(±|to) ?[-+−]?[\d.,]+(e[-+]?\d+)?( ?%)?)?\*?|-"
)


@dataclass(frozen=True)
class Prose:
    """A paragraph."""

    kind: ClassVar[str] = "prose"
    text: str


@dataclass(frozen=True)
class Facts:
    """Names and what each of them is."""

    kind: ClassVar[str] = "facts"
    pairs: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Table:
    """Rows below named columns; `label` names it. A `folded` one is opened by its reader.

    `marked` are the indices of rows to look at first.
    """

    kind: ClassVar[str] = "table"
    label: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    marked: frozenset[int] = frozenset()
    folded: bool = False

    @property
    def numeric(self) -> list[bool]:
        """Whether a column holds numbers, which stand on the right: (columns,)."""
        columns = [[row[k] for row in self.rows] for k in range(len(self.columns))]
        return [bool(c) and all(map(_NUMBER.fullmatch, c)) for c in columns]


@dataclass(frozen=True)
class Picture:
    """A figure; `label` is its name, `text` says what it shows in words.

    `svg` is the text of its `<svg>`, `narrow` that of another for a phone, if there is one. A
    screen reader reads `spoken`, by default `text`.
    """

    kind: ClassVar[str] = "picture"
    label: str
    svg: str
    narrow: str = ""
    text: str = ""
    spoken: str = ""

    @classmethod
    def of(cls, label: str, draw: Callable[[AnyStyle], Figure], text: str = "") -> Picture:
        """The figure that `draw` draws in a style."""
        return cls(label, draw(STYLE).svg(), draw(None).svg(), text)


@dataclass(frozen=True)
class Code:
    """Text whose blanks and line breaks count; `label` names it. Long lines break if it `wraps`."""

    kind: ClassVar[str] = "code"
    label: str
    text: str
    wraps: bool = False


@dataclass(frozen=True)
class Tile:
    """A qubit: `share` in [0, 1] of the worst error colours it, `circuits` are placed on it.

    `why` says why it is left out; it is empty where it is not.
    """

    qubit: int
    error: str
    share: float
    circuits: str = ""
    why: str = ""


@dataclass(frozen=True)
class Qubits:
    """The qubits of a device as tiles."""

    kind: ClassVar[str] = "qubits"
    label: str
    tiles: Sequence[Tile]
    note: str


@dataclass(frozen=True)
class Film:
    """A film of the type `media`, "video/mp4" or the like; `poster` is a still as a PNG file."""

    kind: ClassVar[str] = "film"
    label: str
    media: str
    data: bytes
    poster: bytes
    text: str


@dataclass(frozen=True)
class Heading:
    """A title within a section."""

    kind: ClassVar[str] = "heading"
    text: str


Block = Prose | Facts | Table | Picture | Code | Qubits | Film | Heading


@dataclass(frozen=True)
class Section:
    """A titled part of the page; one without blocks is left out."""

    title: str
    blocks: Sequence[Block]

    @property
    def anchor(self) -> str:
        return re.sub(r"\W+", "-", self.title.lower()).strip("-")


@dataclass(frozen=True)
class Score:
    """The number that the page is about, in words, with its uncertainty below it."""

    label: str
    value: str
    unit: str = ""
    interval: str = ""


@dataclass(frozen=True)
class Document:
    """A report. `kind` is the verb that made the result, `command` how it was called, if known.

    `packages` are those whose versions it names, besides qcompile and Python.
    """

    kind: str
    title: str
    lead: str
    score: Score | None
    facts: Sequence[tuple[str, str]]
    sections: Sequence[Section]
    warnings: Sequence[str] = ()
    packages: Sequence[str] = ("numpy", "torch", "gymnasium")
    command: str = field(default="", kw_only=True)
