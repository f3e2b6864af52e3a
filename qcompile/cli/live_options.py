"""Options of commands that can run on real hardware."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from qcompile.cli.options import Decorator, Positive
from qcompile.limits import MAX_QPU_SECONDS

runs_option: Decorator = click.option(
    "--runs",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("runs"),
    show_default=True,
    envvar="QCOMPILE_RUNS",
    help="Folder of the journals of live runs.",
)
seconds_option: Decorator = click.option(
    "--max-qpu-seconds",
    type=Positive("seconds", most=MAX_QPU_SECONDS),
    help="With --live: the run stops before it would take more.",
)
wait_option: Decorator = click.option(
    "--max-wait-seconds",
    type=Positive("seconds"),
    help="Give up waiting for a job after so long; `resume` fetches it.  [default: wait]",
)
pace_option: Decorator = click.option(
    "--jobs-per-minute",
    type=click.IntRange(1),
    metavar="N",
    help="Send at most N jobs in any minute, where an account may send no more.  [default: no "
    "limit; `resume` keeps that of its run]",
)
yes_option: Decorator = click.option("--yes", is_flag=True, help="Spend without asking.")

_SHARED = (
    click.option(
        "--live",
        is_flag=True,
        help="Run on IBM's machine that --backend names. This spends.",
    ),
    seconds_option,
    yes_option,
    click.option("--account", help="Account of IBM's own tools.  [default: theirs]"),
    click.option("--instance", help="CRN or name; without, only the free Open Plan is used."),
    click.option("--batch", is_flag=True, help="Send the jobs as a batch of IBM's."),
    pace_option,
    wait_option,
    runs_option,
)
_NEED_LIVE = (
    *("max_qpu_seconds", "yes", "account", "instance", "batch"),
    *("jobs_per_minute", "max_wait_seconds"),
)


def live_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give the command the options of a live run; it gets them as `live`, None without --live."""

    @functools.wraps(function)
    def called(**values: Any) -> Any:
        wanted, runs = values.pop("live"), values.pop("runs")
        given = {name: values.pop(name) for name in _NEED_LIVE}
        if not wanted:
            for name, value in given.items():
                if value:
                    option = f"--{name.replace('_', '-')}"
                    raise click.UsageError(f"{option} is for --live.")
            return function(live=None, **values)
        if given["max_qpu_seconds"] is None:
            raise click.UsageError(
                "--live needs --max-qpu-seconds: the run stops before it would take more. "
                "`qcompile plan` says how many it takes."
            )
        from qcompile.sweep.arguments import ignore
        from qcompile.verbs.live import Live

        given["max_wait_s"] = given.pop("max_wait_seconds")
        given["confirm"] = ignore if given.pop("yes") else confirm
        return function(live=Live(runs=runs, **given), **values)

    for option in reversed(_SHARED):
        called = option(called)
    return called


def confirm(question: str, hint: str = "In a script say --yes.") -> None:
    """Nothing, if somebody says yes; `hint` is for those who cannot be asked.

    Raises:
        click.Abort: somebody says no.
        LiveError: nobody is there to say it.
    """
    from qcompile.errors import LiveError

    try:
        click.confirm(question, abort=True, err=True)
    except click.Abort:
        if not somebody_is_there():
            click.echo(err=True)
            raise LiveError("Nobody said yes. Nothing was sent.", hint) from None
        raise


def somebody_is_there() -> bool:
    """Whether a question would be read by somebody."""
    return sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty()
