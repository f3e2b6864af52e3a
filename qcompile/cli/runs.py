"""`qcompile runs`: list, show and export live runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from qcompile.cli.live_options import runs_option
from qcompile.cli.options import Decorator, echo_json, json_option

_subcommand_runs_option: Decorator = click.option(
    "--runs",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder that records live runs.  [default: runs]",
)


@click.group("runs", invoke_without_command=True)
@runs_option
@json_option
@click.pass_context
def command(ctx: click.Context, runs: Path, as_json: bool) -> None:
    """List live runs, the newest last; `show` or `export` one of them.

    If some runs cannot be read, the others are listed and the exit code is 1.
    """
    from qcompile.errors import LiveError
    from qcompile.live.runs import journals
    from qcompile.report.live import overview

    ctx.obj = runs
    if ctx.invoked_subcommand is not None:
        if as_json:
            raise click.UsageError("Put --json at the end: runs show ID --json")
        return
    damaged: list[str] = []
    overviews = []
    for journal in journals(runs, damaged.append):
        try:
            overviews.append(overview(journal))
        except LiveError as error:
            damaged.append(str(error))
    if as_json:
        echo_json(overviews)
    elif overviews:
        _print_runs(overviews)
    else:
        click.echo("There are no other runs." if damaged else f"There are no live runs in {runs}.")
    for words in damaged:
        click.echo(f"Error: {words}", err=True)
    ctx.exit(1 if damaged else 0)


def _print_runs(overviews: list[dict[str, Any]]) -> None:
    from qcompile.report.tables import plural, print_table
    from qcompile.terminal import one_line

    print_table(
        ["run", "kind", "backend", "state", "QPU seconds", "charged", "in doubt"],
        [
            [
                row["run"],
                row["kind"],
                one_line(str(row["backend"]), 40),
                row["state"],
                f"{row['qpu_seconds']:.1f} of {row['max_qpu_seconds']:g}",
                f"{row['qpu_seconds_settled']:.1f}",
                plural(row["jobs_in_doubt"], "job") if row["jobs_in_doubt"] else "",
            ]
            for row in overviews
        ],
        tight=True,
    )


@command.command("show")
@click.argument("run_id", metavar="ID")
@_subcommand_runs_option
@json_option
@click.pass_obj
def show(of_group: Path, run_id: str, runs: Path | None, as_json: bool) -> None:
    """Show the result of run ID, or its progress if it is not finished."""
    from qcompile.live.finder import describe_doubts
    from qcompile.live.perform import finished
    from qcompile.live.runs import find_journal
    from qcompile.report.live import overview, print_overview, print_result, result_values

    with find_journal(runs or of_group, run_id) as journal:
        result = None if journal.result is None else finished(journal)
        if as_json:
            shown = None if result is None else result_values(journal.kind, result)
            echo_json({**overview(journal), "result": shown})
        elif result is not None:
            print_result(journal.kind, result)
            for line in describe_doubts(journal):
                click.echo(line)
        else:
            print_overview(journal)


@command.command("export")
@click.argument("run_id", metavar="ID")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write, overwritten.  [default: standard output]",
)
@_subcommand_runs_option
@click.pass_obj
def export(of_group: Path, run_id: str, out: Path | None, runs: Path | None) -> None:
    """Write the whole record of run ID as JSON: settings, jobs with counts, steps, result."""
    import json

    from qcompile.clashes import check_clashes
    from qcompile.live.runs import find_journal
    from qcompile.output import write_file
    from qcompile.report.live import exported

    with find_journal(runs or of_group, run_id) as journal:
        check_clashes({"the journal": journal.path}, {"--out": out})
        values = exported(journal)
    if out is None:
        click.echo(json.dumps(values))
        return
    write_file(out, json.dumps(values).encode() + b"\n")
    click.echo(f"{len(values['jobs'])} jobs and {len(values['steps'])} steps in {out}")
