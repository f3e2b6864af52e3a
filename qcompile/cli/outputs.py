"""The options that save what a command shows: a figure, in any style, a table and a page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import click

from qcompile.cli.options import Decorator, echo_note
from qcompile.cli.typed_command import typed_command
from qcompile.cli.types import OutputPath

if TYPE_CHECKING:
    from qcompile.report.figure import Figure
    from qcompile.report.table import Table
    from qcompile.report.trial import Kind

report_option: Decorator = click.option(
    "--report",
    type=OutputPath(".html"),
    help="Write an HTML page with scores, figures, circuits and settings; .html, overwritten.",
)


class Shown(Protocol):
    """The result of a command; that of a command with --report is a `Reported`."""

    def plot(self, *, style: Any = None) -> Figure: ...

    def table(self) -> Table: ...


@dataclass(frozen=True)
class Outputs:
    """The files for a figure, a table and a page, None if they are not requested."""

    plot: Path | None = None
    style: Path | None = None
    table: Path | None = None
    report: Path | None = None

    def check(self, kind: Kind) -> None:
        """Check the files, and draw a trial figure in the style, before anything is run.

        Whatever the command runs then checks that they are none of its own files.

        Raises:
            QcompileError: a file cannot be written; the style cannot be read or drawn with.
        """
        from qcompile.clashes import beside
        from qcompile.output import check_writable

        if self.style is not None and self.plot is None:
            raise click.UsageError("--style needs --plot.")
        writes = {"--plot": self.plot, "--table": self.table, "--report": self.report}
        files = beside(reads={"--style": self.style}, writes=writes)
        click.get_current_context().with_resource(files)
        for path in writes.values():
            if path is not None:
                check_writable(path)
        if self.plot is not None and self.style is not None:
            from qcompile.report.trial import check_style

            check_style(kind, self.style, self.plot)

    def save(
        self, result: Shown, check: Callable[[], None] = lambda: None, *, is_empty: bool = False
    ) -> None:
        """Save every file, even if another one cannot be saved, and print where they are.

        A result that `is_empty` is not saved: earlier files stay as they are.

        Raises:
            QcompileError: `check` of the result says so; there is nothing to draw; a file cannot be
                written; Ctrl-C. One message has all of them.
        """
        from qcompile.errors import QcompileError
        from qcompile.verbs.reports import Reported

        def draw(path: Path) -> None:
            result.plot(style=self.style).save(path)

        def tabulate(path: Path) -> None:
            result.table().save(path)

        def report(path: Path) -> None:
            assert isinstance(result, Reported)
            result.report(path, command=typed_command())

        steps = (
            ("figure", self.plot, draw),
            ("table", self.table, tabulate),
            ("report", self.report, report),
        )
        failures: list[Exception] = []
        try:
            check()
        except QcompileError as error:
            failures.append(error)
        if is_empty and any(path is not None for _, path, _ in steps):
            echo_note("nothing written: no episode was finished")
        for what, path, write in () if is_empty else steps:
            if path is None:
                continue
            try:
                write(path)
            except KeyboardInterrupt:
                failures.append(QcompileError(f"Interrupted: {path} was not written."))
                break
            except Exception as error:
                failures.append(error)
            else:
                echo_note(f"{what} written to {path}")
        _raise(failures)


def _raise(failures: list[Exception]) -> None:
    """Raise the failures as one error; one that is a defect of qcompile comes first."""
    from qcompile.errors import QcompileError

    explained = [error for error in failures if isinstance(error, QcompileError)]
    for error in failures:
        if error not in explained:
            raise error
    if explained:
        first, *others = explained
        raise first.with_hints(*map(str, others)) if others else first


def output_options(figure: str, kind: Kind) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The options --plot, --style and --table; the function gets them, checked, as `outputs`.

    So it gets --report, where it has `report_option`. `figure` describes the figure, `kind` says
    how it is drawn.
    """
    plot_help = f"Draw {figure}; .png, .svg or .pdf, overwritten."

    def decorate(function: Callable[..., None]) -> Callable[..., None]:
        @click.option("--plot", type=OutputPath(".png", ".svg", ".pdf"), help=plot_help)
        @click.option(
            "--style",
            type=click.Path(dir_okay=False, path_type=Path),
            metavar="FILE.mplstyle",
            help="Fonts, sizes and colours of --plot: a matplotlib style file.",
        )
        @click.option(
            "--table",
            type=OutputPath(".md", ".csv", ".tex"),
            help="Save the table; .md, .csv or .tex, overwritten.",
        )
        @wraps(function)
        def command(
            *args: Any, plot: Path | None, style: Path | None, table: Path | None, **options: Any
        ) -> None:
            outputs = Outputs(plot, style, table, options.pop("report", None))
            outputs.check(kind)
            function(*args, outputs=outputs, **options)

        return command

    return decorate
