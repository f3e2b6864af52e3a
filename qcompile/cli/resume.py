"""`qcompile resume`: go on with a live run."""

from __future__ import annotations

from pathlib import Path

import click

from qcompile.cli.live_options import (
    confirm,
    follow,
    runs_option,
    somebody_is_there,
    wait_option,
    yes_option,
)
from qcompile.cli.options import Positive, echo_json, json_option
from qcompile.limits import MAX_QPU_SECONDS


@click.command("resume")
@click.argument("run_id", metavar="ID")
@click.option(
    "--max-qpu-seconds",
    type=Positive("seconds", most=MAX_QPU_SECONDS),
    help="Another limit.  [default: the run's]",
)
@yes_option
@wait_option
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File for a calibration.  [default: the one it was begun with]",
)
@runs_option
@json_option
def command(
    run_id: str,
    max_qpu_seconds: float | None,
    yes: bool,
    max_wait_seconds: float | None,
    out: Path | None,
    runs: Path,
    as_json: bool,
) -> None:
    """Go on with run ID (a part of it will do, `last` is the newest) where it stopped.

    What was paid for is fetched and not paid again. The limit stays that of the run unless
    --max-qpu-seconds sets another; a higher one is confirmed. So is to send a job again that was
    charged and gave no counts. A finished run shows its result. A calibration is written to its
    file, and nothing is drawn or checked.
    """
    from qcompile.errors import PaidFailureError
    from qcompile.live.runs import find_journal
    from qcompile.report.live import print_result, result_values

    with find_journal(runs, run_id) as journal:
        pay_again = yes
        if max_qpu_seconds is not None and journal.result is None:
            was = journal.max_qpu_seconds
            if max_qpu_seconds > was:
                if not yes:
                    confirm(f"Allow {max_qpu_seconds:g} QPU seconds instead of {was:g}?")
                pay_again = True
            with journal.held():
                journal.allow(max_qpu_seconds)
        try:
            result = follow(journal, max_wait_seconds, out, pay_again)
        except PaidFailureError as error:
            if not somebody_is_there():
                raise
            click.echo(error, err=True)
            confirm("Send it again?")
            result = follow(journal, max_wait_seconds, out, pay_again=True)
    if as_json:
        echo_json(result_values(journal.kind, result))
    else:
        print_result(journal.kind, result)
