"""The option --report of several commands."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from qcompile.cli.options import Decorator, OutputPath, echo_note

if TYPE_CHECKING:
    from qcompile.verbs.reports import Reported


report_option: Decorator = click.option(
    "--report",
    type=OutputPath(".html"),
    help="Write an HTML page with scores, figures, circuits and settings; .html, overwritten.",
)


def check_report(report: Path | None, **others: Path | None) -> None:
    """Check that the page can be written and is none of the other files.

    Raises:
        OptionError: it is one of the other files.
        OutputError: it cannot be written.
    """
    if report is None:
        return
    from qcompile.output import check_writable
    from qcompile.verbs.files import check_distinct

    for option, path in others.items():
        check_distinct({"report": report, option: path})
    check_writable(report)


def write_report(result: Reported, report: Path | None) -> None:
    """Write the page of a result, if requested, with the command line that was typed.

    Raises:
        OutputError: it cannot be written.
    """
    if report is None:
        return
    from qcompile.page.words import command_line

    result.report(report, command=command_line(sys.argv[1:]))
    echo_note(f"report written to {report}")
