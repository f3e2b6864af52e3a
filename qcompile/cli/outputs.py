"""The options that save what a command shows: a figure, in any style, and a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import click

from qcompile.cli.options import Decorator, echo_note

if TYPE_CHECKING:
    from qcompile.report.figure import Figure
    from qcompile.report.table import Table

_FILE = click.Path(dir_okay=False, path_type=Path)

style_option: Decorator = click.option(
    "--style",
    type=_FILE,
    metavar="FILE.mplstyle",
    help="Style of --plot: fonts, sizes and colours, as in a style file of matplotlib.",
)
table_option: Decorator = click.option(
    "--table", type=_FILE, help="Save the table; .md, .csv or .tex, overwritten."
)


class Shown(Protocol):
    """What a command found."""

    def plot(self, *, style: Any = None) -> Figure: ...

    def table(self) -> Table: ...


@dataclass(frozen=True)
class Outputs:
    """Where a figure and a table are saved; nothing where none is asked for."""

    plot: Path | None = None
    style: Path | None = None
    table: Path | None = None

    def check(self) -> None:
        """Nothing, if they can be saved and the style can be read: before anything long is run.

        Raises:
            QcompileError: they cannot.
        """
        from qcompile.output import check_writable

        if self.style is not None and self.plot is None:
            raise click.UsageError("--style is the style of --plot: name a file to draw to.")
        if self.plot is not None:
            from qcompile.report.figure import check_figure_path
            from qcompile.report.style import Style

            check_figure_path(self.plot)
            check_writable(self.plot)
            Style.of(self.style)
        if self.table is not None:
            from qcompile.report.table import check_table_path

            check_table_path(self.table)
            check_writable(self.table)

    def save(self, result: Shown) -> None:
        """Save them, and say where.

        Raises:
            QcompileError: there is nothing to draw; a file cannot be written.
        """
        if self.plot is not None:
            result.plot(style=self.style).save(self.plot)
        if self.table is not None:
            result.table().save(self.table)
        written = {"figure": self.plot, "table": self.table}
        for what, path in written.items():
            if path is not None:
                echo_note(f"{what} written to {path}")


def plot_option(figure: str) -> Decorator:
    """The option --plot; `figure` says what is drawn."""
    words = f"Draw {figure}; .png, .svg or .pdf, overwritten."
    return click.option("--plot", type=_FILE, help=words)


def output_options(figure: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The options --plot, --style and --table, checked; the function gets them as `outputs`.

    `figure` says what is drawn.
    """

    def decorate(function: Callable[..., None]) -> Callable[..., None]:
        @plot_option(figure)
        @style_option
        @table_option
        @wraps(function)
        def command(
            *args: Any, plot: Path | None, style: Path | None, table: Path | None, **options: Any
        ) -> None:
            outputs = Outputs(plot, style, table)
            outputs.check()
            function(*args, outputs=outputs, **options)

        return command

    return decorate
