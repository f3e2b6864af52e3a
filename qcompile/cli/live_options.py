"""Options of commands that can run on IBM hardware."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from qcompile.cli.options import Decorator
from qcompile.cli.types import Integer, Positive
from qcompile.limits import MAX_QPU_SECONDS

runs_option: Decorator = click.option(
    "--runs",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("runs"),
    show_default=True,
    envvar="QCOMPILE_RUNS",
    help="Folder that records live runs.",
)
seconds_option: Decorator = click.option(
    "--max-qpu-seconds",
    type=Positive("seconds", most=MAX_QPU_SECONDS),
    help="With --live: the most QPU seconds to use. The run stops before it would exceed them.",
)
wait_option: Decorator = click.option(
    "--max-wait-seconds",
    type=Positive("seconds"),
    help="Stop waiting for a job after this time; `qcompile resume` fetches it later.  [default: "
    "no limit]",
)
pace_option: Decorator = click.option(
    "--jobs-per-minute",
    type=Integer(1),
    metavar="N",
    help="Send at most N jobs a minute, for accounts with a rate limit.  [default: no limit]",
)
yes_option: Decorator = click.option(
    "--yes", is_flag=True, help="Spend QPU time without asking first."
)

_SHARED = (
    click.option(
        "--live",
        is_flag=True,
        help="Run on IBM hardware instead of a simulation. This spends QPU time.",
    ),
    seconds_option,
    yes_option,
    click.option(
        "--account",
        help="Name of an account saved with qiskit-ibm-runtime.  [default: its default account]",
    ),
    click.option(
        "--instance",
        help="CRN or name of an IBM instance.  [default: the account's, or one on the free Open "
        "Plan]",
    ),
    click.option("--batch", is_flag=True, help="Send the jobs as one IBM batch."),
    pace_option,
    wait_option,
    runs_option,
)
_NEED_LIVE = (
    *("max_qpu_seconds", "yes", "account", "instance", "batch"),
    *("jobs_per_minute", "max_wait_seconds"),
)


def live_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of a live run to a command, which gets `live`: None without --live."""

    @functools.wraps(function)
    def called(**values: Any) -> Any:
        wanted, runs = values.pop("live"), values.pop("runs")
        given = {name: values.pop(name) for name in _NEED_LIVE}
        if not wanted:
            for name, value in given.items():
                if value:
                    option = f"--{name.replace('_', '-')}"
                    raise click.UsageError(f"{option} needs --live.")
            return function(live=None, **values)
        if given["max_qpu_seconds"] is None:
            raise click.UsageError(
                "--live needs --max-qpu-seconds, the most QPU time the run may use. "
                "`qcompile plan` estimates how much it needs."
            )
        from qcompile.sweep.arguments import ignore
        from qcompile.verbs.live import Live

        given["max_wait_s"] = given.pop("max_wait_seconds")
        given["confirm"] = ignore if given.pop("yes") else confirm
        return function(live=Live(runs=runs, **given), **values)

    for option in reversed(_SHARED):
        called = option(called)
    return called


def confirm(question: str, hint: str = "In a script, add --yes.") -> None:
    """Return if the user answers yes; `hint` is what to do where nobody can answer.

    Raises:
        click.Abort: the user answers no.
        LiveError: nobody is there to answer.
    """
    from qcompile.errors import LiveError

    try:
        click.confirm(question, abort=True, err=True)
    except click.Abort:
        if not is_interactive():
            click.echo(err=True)
            raise LiveError("The question was not answered. Nothing was sent.", hint) from None
        raise


def is_interactive() -> bool:
    """Whether a user can answer questions on standard input."""
    return sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty()
