"""`qcompile resume`: resume a live run where it stopped."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from qcompile.cli.live_options import (
    confirm,
    is_interactive,
    pace_option,
    runs_option,
    wait_option,
    yes_option,
)
from qcompile.cli.options import echo_json, echo_note, import_option, json_option
from qcompile.cli.types import Positive
from qcompile.limits import MAX_QPU_SECONDS

if TYPE_CHECKING:
    from qcompile.live.journal import Journal


@click.command("resume")
@click.argument("run_id", metavar="ID")
@click.option(
    "--max-qpu-seconds",
    type=Positive("seconds", most=MAX_QPU_SECONDS),
    help="A new limit for the whole run.  [default: the run's]",
)
@yes_option
@pace_option
@wait_option
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File to write a calibration to.  [default: the one that `calibrate` was given]",
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
    """Resume run ID where it stopped, or show its result if it is finished.

    Any unique part of ID is enough, and `last` is the newest run. Jobs that were paid for are
    fetched, not sent again.

    qcompile asks before it raises the limit, before it sends a job again that was charged but gave
    no counts, and before it resumes a run that comes from another folder or another machine. In a
    script, --yes answers; a run from another machine needs --max-qpu-seconds as well.

    A calibration is written to its file if it was started in this folder. The options --plot and
    --check of `calibrate` have no effect here.
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
            if not is_interactive():
                raise
            click.echo(error, err=True)
            confirm("Send it again?")
            result = resume(pay_again=True)
        kind = journal.kind
    if kind == "calibrate" and result["file"] is None:
        click.echo(
            "The calibration is only in the journal. "
            f"`qcompile resume {run_id} --out FILE` writes it to a file.",
            err=True,
        )
    if as_json:
        echo_json(result_values(kind, result))
    else:
        print_result(kind, result)


def _agree(journal: Journal, max_qpu_seconds: float | None, yes: bool) -> None:
    """Ask about a raised limit, or about a run that was started elsewhere.

    Raises:
        LiveError: nobody is there to answer, or `yes` needs a limit beside it.
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
            confirm("Resume it here?", f"In a script, add --yes{also}.")
        elif foreign and max_qpu_seconds is None:
            raise LiveError(
                f"The run's limit of {limit_s:g} QPU seconds was set on another machine. "
                "Nothing was sent.",
                "Give a limit with --max-qpu-seconds beside --yes.",
            )
    elif max_qpu_seconds is not None and max_qpu_seconds > limit_s and not yes:
        confirm(f"Allow {max_qpu_seconds:g} QPU seconds instead of {limit_s:g}?")
    if strange or max_qpu_seconds is not None:
        with journal.locked():  # which marks the run as resumed in this folder
            if max_qpu_seconds is not None:
                journal.allow(max_qpu_seconds)
