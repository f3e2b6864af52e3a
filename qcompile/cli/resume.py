"""`qcompile resume`: resume a live run."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from qcompile.cli.live_options import (
    confirm,
    pace_option,
    runs_option,
    somebody_is_there,
    wait_option,
    yes_option,
)
from qcompile.cli.options import (
    Positive,
    echo_json,
    echo_note,
    import_option,
    json_option,
)
from qcompile.limits import MAX_QPU_SECONDS

if TYPE_CHECKING:
    from qcompile.live.journal import Journal


@click.command("resume")
@click.argument("run_id", metavar="ID")
@click.option(
    "--max-qpu-seconds",
    type=Positive("seconds", most=MAX_QPU_SECONDS),
    help="Another limit.  [default: the run's]",
)
@yes_option
@pace_option
@wait_option
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File for a calibration.  [default: the one it was begun with]",
)
@import_option
@runs_option
@json_option
def command(
    run_id: str,
    max_qpu_seconds: float | None,
    yes: bool,
    jobs_per_minute: int | None,
    max_wait_seconds: float | None,
    out: Path | None,
    imports: tuple[str, ...],
    runs: Path,
    as_json: bool,
) -> None:
    """Resume run ID (a part of it will do, `last` is the newest) where it stopped.

    What was paid for is fetched and not paid again. The limit stays that of the run unless
    --max-qpu-seconds sets another; a higher one is confirmed. Sending a job again that was charged
    and gave no counts is confirmed too. A run that was last resumed in another folder or on another
    machine shows what it would do and is confirmed; in a script that takes --yes, and
    --max-qpu-seconds where it began on another machine. A finished run shows its result. A
    calibration is written to its file, if it began here, and nothing is drawn or checked.
    """
    from qcompile.deploy.registration import import_modules
    from qcompile.errors import PaidFailureError
    from qcompile.live.runs import find_journal
    from qcompile.report.live import print_result, result_values
    from qcompile.verbs.live import follow

    import_modules(imports)
    with find_journal(runs, run_id) as journal:
        pay_again = yes or (max_qpu_seconds or 0) > journal.max_qpu_seconds
        if journal.result is None:
            _agree(journal, max_qpu_seconds, yes)
        resume = partial(
            follow,
            journal,
            max_wait_seconds,
            echo_note,
            out=out,
            jobs_per_minute=jobs_per_minute,
        )
        try:
            result = resume(pay_again=pay_again)
        except PaidFailureError as error:
            if not somebody_is_there():
                raise
            click.echo(error, err=True)
            confirm("Send it again?")
            result = resume(pay_again=True)
        kind = journal.kind
    if kind == "calibrate" and result["file"] is None:
        words = f"The calibration is in the journal alone: `qcompile resume {run_id} --out FILE`"
        click.echo(f"{words} writes it to a file.", err=True)
    if as_json:
        echo_json(result_values(kind, result))
    else:
        print_result(kind, result)


def _agree(journal: Journal, max_qpu_seconds: float | None, yes: bool) -> None:
    """Have confirmed whatever the user of this command line may not know of the run.

    Raises:
        LiveError: nobody is there to confirm it, or `yes` does not say enough.
    """
    from qcompile.errors import LiveError
    from qcompile.live.perform import is_from_another_machine, resume_warning
    from qcompile.report.live import terms

    limit_s = journal.max_qpu_seconds
    strange, foreign = resume_warning(journal), is_from_another_machine(journal)
    if strange:
        click.echo(strange, err=True)
        click.echo(terms(journal, max_qpu_seconds or limit_s), err=True)
        if not yes:
            also = " and --max-qpu-seconds S" if foreign else ""
            confirm("Resume it here?", f"In a script say --yes{also}.")
        elif foreign and max_qpu_seconds is None:
            raise LiveError(
                f"Its limit of {limit_s:g} QPU seconds was set elsewhere. Nothing was sent.",
                "Say --max-qpu-seconds S together with --yes.",
            )
    elif max_qpu_seconds is not None and max_qpu_seconds > limit_s and not yes:
        confirm(f"Allow {max_qpu_seconds:g} QPU seconds instead of {limit_s:g}?")
    if strange or max_qpu_seconds is not None:
        with journal.locked():  # which makes it at home here
            if max_qpu_seconds is not None:
                journal.allow(max_qpu_seconds)
