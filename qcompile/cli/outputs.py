"""The options that save what a command shows: a figure, in any style, and a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import click

from qcompile.cli.options import Decorator, OutputPath, echo_note

if TYPE_CHECKING:
    from qcompile.report.figure import Figure
    from qcompile.report.table import Table

style_option: Decorator = click.option(
    "--style",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.mplstyle",
    help="Fonts, sizes and colours of --plot: a matplotlib style file.",
)
table_option: Decorator = click.option(
    "--table",
    type=OutputPath(".md", ".csv", ".tex"),
    help="Save the table; .md, .csv or .tex, overwritten.",
)


class Shown(Protocol):
    """The result of a command."""

    def plot(self, *, style: Any = None) -> Figure: ...

    def table(self) -> Table: ...


@dataclass(frozen=True)
class Outputs:
    """The files for a figure and a table, None if they are not requested."""

    plot: Path | None = None
    style: Path | None = None
    table: Path | None = None

    def check(self) -> None:
        """Check that the files can be written and the style can be read, before anything is run.

        Raises:
            QcompileError: a file cannot be written, or the style cannot be read.
        """
        from qcompile.output import check_writable

        if self.style is not None and self.plot is None:
            raise click.UsageError("--style needs --plot.")
        if self.plot is not None:
            from qcompile.report.style import Style

            check_writable(self.plot)
            Style.of(self.style)
        if self.table is not None:
            check_writable(self.table)

    def save(self, result: Shown) -> None:
        """Save the figure and the table, and print where they are.

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
    """The option --plot; `figure` describes the figure."""
    words = f"Draw {figure}; .png, .svg or .pdf, overwritten."
    return click.option("--plot", type=OutputPath(".png", ".svg", ".pdf"), help=words)


def output_options(figure: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The options --plot, --style and --table, checked; the function gets them as `outputs`.

    `figure` describes the figure.
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
