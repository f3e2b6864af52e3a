"""Figures that a notebook shows by itself, and that are saved as .png, .svg or .pdf."""

from __future__ import annotations

import re
import warnings
from io import BytesIO
from os import PathLike
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from qcompile.characters import for_markup
from qcompile.errors import FigureError
from qcompile.output import checked_path, write_file
from qcompile.report.style import Style

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

SUFFIXES = (".png", ".svg", ".pdf")
_TITLE_AT = 0.01
"""Where a title begins, of the width of a figure."""

_UNDATED: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
"""Without dates and versions the same figure is the same file."""
_NUMBERED = re.compile(r'<g id="[\w.]+_\d+">')
"""The names matplotlib gives to groups: two figures on one page would have the same."""


def check_figure_path(path: Path) -> None:
    """Nothing, if a figure can be saved under such a name.

    Raises:
        FigureError: it has another ending.
    """
    if path.suffix not in SUFFIXES:
        raise FigureError(f"{path} must end with .png, .svg or .pdf.")


class Figure:
    """A figure, drawn: `save` writes it, `png`, `svg()` and `pdf()` are what it writes."""

    def __init__(self, drawing: Drawing, style: Style):
        self._drawing, self._style = drawing, style
        self._files: dict[str, bytes] = {}

    @property
    def png(self) -> bytes:
        """The bytes of a .png file.

        Raises:
            FigureError: the style leaves no room for what is drawn.
        """
        return self._file("png")

    def svg(self) -> str:
        """The text of an <svg> element: a file's, or to stand in a page of HTML.

        Raises:
            FigureError: as `png`.
        """
        text = self._file("svg").decode()
        return _NUMBERED.sub("<g>", text[text.index("<svg") :])

    def pdf(self) -> bytes:
        """The bytes of a .pdf file, whose fonts are embedded.

        Raises:
            FigureError: as `png`.
        """
        return self._file("pdf")

    def save(self, path: str | PathLike[str]) -> None:
        """Write the figure to a .png, .svg or .pdf file, which is overwritten.

        Raises:
            FigureError: the file has another ending; as `png`.
            OptionError: the path is neither a name nor a path.
            OutputError: the file cannot be written.
        """
        file = checked_path(path)
        check_figure_path(file)
        write_file(file, self.contents(file.suffix))

    def contents(self, suffix: str) -> bytes:
        """The bytes of a file with this suffix.

        Raises:
            FigureError: as `png`.
        """
        return self.svg().encode() if suffix == ".svg" else self._file(suffix.removeprefix("."))

    def _file(self, form: str) -> bytes:
        if form not in self._files:
            stream = BytesIO()
            with self._style.applied(), warnings.catch_warnings():
                warnings.filterwarnings("error", "constrained_layout not applied", UserWarning)
                try:
                    self._drawing.savefig(stream, format=form, metadata=_UNDATED[form])
                except UserWarning:
                    raise FigureError(
                        "The style leaves no room for what is drawn.",
                        "Give it a greater figure.figsize, or smaller fonts.",
                    ) from None
            self._files[form] = stream.getvalue()
        return self._files[form]

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        width, height = self._drawing.get_size_inches()
        return f"Figure({width:.1f} x {height:.1f} in; .save('figure.pdf') writes it)"


def write_title(drawing: Drawing, words: str) -> None:
    """Write the title above a drawing, in lines that fit.

    A figure.titlesize of 0, in the style that is applied, leaves it out.
    """
    import matplotlib as mpl

    if mpl.rcParams["figure.titlesize"] == 0:
        return
    title = drawing.suptitle(literal(words), x=_TITLE_AT, ha="left")
    share = title.get_window_extent().width / ((1 - 2 * _TITLE_AT) * drawing.bbox.width)
    if share > 1:
        title.set_text(literal("\n".join(wrap(words, max(int(len(words) / share), 1)))))


def literal(words: str) -> str:
    """Words as they are: to matplotlib a pair of dollars would be mathematics."""
    return for_markup(words).replace("$", r"\$")
