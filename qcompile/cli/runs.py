"""`qcompile runs`: the live runs, and what their journals hold."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.live_options import runs_option
from qcompile.cli.options import echo_json, json_option

if TYPE_CHECKING:
    from qcompile.live.journal import Journal, Kind


@click.group("runs", invoke_without_command=True)
@runs_option
@json_option
@click.pass_context
def command(ctx: click.Context, runs: Path, as_json: bool) -> None:
    """List the live runs, the newest last; `show` one, or `export` all that one holds."""
    from qcompile.live.journal import journals
    from qcompile.report.tables import print_table

    ctx.obj = runs
    if ctx.invoked_subcommand is not None:
        if as_json:
            raise click.UsageError("--json goes behind the name: runs show ID --json")
        return
    found = [
        overview(journal) for journal in journals(runs, lambda words: click.echo(words, err=True))
    ]
    if as_json:
        echo_json(found)
        return
    if not found:
        click.echo(f"There is no live run in {runs}.")
        return
    print_table(
        ["run", "what", "backend", "state", "QPU seconds"],
        [
            [
                row["run"],
                row["kind"],
                row["backend"],
                row["state"],
                f"{row['qpu_seconds']:.1f} of {row['max_qpu_seconds']:g}",
            ]
            for row in found
        ],
        tight=True,
    )


@command.command("show")
@click.argument("run_id", metavar="ID")
@json_option
@click.pass_obj
def show(runs: Path, run_id: str, as_json: bool) -> None:
    """Show the result of run ID, or where it stands."""
    from qcompile.live.budget import where_it_stands
    from qcompile.live.journal import find_journal

    journal = find_journal(runs, run_id)
    result = journal.result
    if as_json:
        shown = None if result is None else result_values(journal.kind, result)
        echo_json({**overview(journal), "result": shown})
    elif result is not None:
        print_result(journal.kind, result)
    else:
        row = overview(journal)
        click.echo(f"{row['run']} on {row['backend']}: {row['state']}")
        click.echo(where_it_stands(journal))
        click.echo(
            f"{row['qpu_seconds']:.1f} of {row['max_qpu_seconds']:g} QPU seconds are charged"
        )
        click.echo(f"`qcompile resume {row['run']}` goes on.")


@command.command("export")
@click.argument("run_id", metavar="ID")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write, overwritten.  [default: standard output]",
)
@click.pass_obj
def export(runs: Path, run_id: str, out: Path | None) -> None:
    """Write all that run ID holds as JSON: settings, jobs with their counts, steps, result."""
    import json

    from qcompile.live.journal import find_journal
    from qcompile.output import write_file

    values = exported(find_journal(runs, run_id))
    if out is None:
        click.echo(json.dumps(values))
        return
    write_file(out, json.dumps(values).encode() + b"\n")
    click.echo(f"{len(values['jobs'])} jobs and {len(values['steps'])} steps in {out}")


def overview(journal: Journal) -> dict[str, Any]:
    """A run in a few plain values."""
    from qcompile.live.budget import Budget

    charges = journal.charges()
    return {
        "run": journal.id,
        "kind": journal.kind,
        "backend": journal.settings.get("backend"),
        "created": journal.created.isoformat(),
        "state": "unfinished" if journal.result is None else "finished",
        "jobs_done": sum(charge.state == "done" for charge in charges),
        "jobs_open": sum(charge.state in ("intended", "sent") for charge in charges),
        "steps": journal.step_count(),
        "qpu_seconds": Budget(journal).charged_s(),
        "max_qpu_seconds": journal.max_qpu_seconds,
    }


def exported(journal: Journal) -> dict[str, Any]:
    """All of a run as plain values."""
    jobs = [
        {
            "number": made.number,
            "attempt": made.attempt,
            "tag": made.tag,
            "job_id": made.job_id,
            "state": made.state,
            "sent": made.created.isoformat(),
            "executions": made.executions,
            "qpu_seconds": made.usage_s,
            "ones": None if made.ones is None else made.ones.tolist(),
            "words": made.words,
        }
        for made in journal.submissions()
    ]
    steps = [
        {
            "observations": step.observations.tolist(),
            "actions": step.actions.tolist(),
            "rewards": None if step.rewards is None else step.rewards.tolist(),
        }
        for step in map(journal.step, range(journal.step_count()))
        if step is not None
    ]
    whole = {"settings": journal.settings, "jobs": jobs, "steps": steps, "result": journal.result}
    return overview(journal) | whole


def result_values(kind: Kind, result: dict[str, Any]) -> dict[str, Any]:
    """What the command that began the run prints with --json."""
    if kind != "calibrate":
        return result
    from qcompile.calibration import Calibration
    from qcompile.report.calibration_values import calibration_values

    rest = {name: value for name, value in result.items() if name != "calibration"}
    return calibration_values(Calibration.model_validate(result["calibration"])) | rest


def charged(result: dict[str, Any]) -> str:
    """A line on what a finished run was charged."""
    return f"run {result['run']} was charged {result['qpu_seconds']:.1f} QPU seconds"


def print_result(kind: Kind, result: dict[str, Any]) -> None:
    """Print what a finished run found."""
    if kind == "run":
        from qcompile.report.tables import print_run

        print_run(result)
    elif kind == "validate":
        from qcompile.cli.validate import print_validation

        print_validation(result)
        click.echo(charged(result))
    else:
        from qcompile.report.calibration_values import print_calibration

        print_calibration(result_values(kind, result))
        if result["file"]:
            click.echo(f"calibration in {result['file']}")
        click.echo(charged(result))
