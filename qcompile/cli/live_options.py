"""Options of commands that can run on real hardware, and the guard that all of them pass."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qcompile.cli.options import Decorator, Positive
from qcompile.limits import FREE_SECONDS, MAX_QPU_SECONDS

if TYPE_CHECKING:
    from qcompile.execution import Workload
    from qcompile.live.connection import Connection
    from qcompile.live.task import Task


@dataclass(frozen=True)
class Live:
    """What a user allows and wants of a live run."""

    max_qpu_seconds: float
    yes: bool
    account: str | None
    instance: str | None
    batch: bool
    runs: Path
    max_wait_s: float | None

    @property
    def where(self) -> dict[str, Any]:
        """The fields of a task that say where it runs."""
        return {"account": self.account, "instance": self.instance, "batch": self.batch}


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
yes_option: Decorator = click.option("--yes", is_flag=True, help="Spend without asking.")

_SHARED = (
    click.option("--live", is_flag=True, help="Run on IBM's machine of that name. This spends."),
    seconds_option,
    yes_option,
    click.option("--account", help="Account of IBM's own tools.  [default: theirs]"),
    click.option("--instance", help="CRN or name; without, only the free Open Plan is used."),
    click.option("--batch", is_flag=True, help="Send the jobs as a batch of IBM's."),
    wait_option,
    runs_option,
)
_NEED_LIVE = ("max_qpu_seconds", "yes", "account", "instance", "batch", "max_wait_seconds")


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
        max_wait_s = given.pop("max_wait_seconds")
        return function(live=Live(runs=runs, max_wait_s=max_wait_s, **given), **values)

    for option in reversed(_SHARED):
        called = option(called)
    return called


def spend(task: Task, load: Workload, live: Live, connection: Connection) -> dict[str, Any]:
    """Show what the task costs, have it confirmed, and do it; what it found.

    The run keeps to the instance by which the connection reaches the backend.

    Raises:
        BudgetError: the task needs more than it is allowed.
        LiveError: it cannot start or go on.
    """
    from qcompile.errors import BudgetError
    from qcompile.live.perform import begin
    from qcompile.report.tables import plural

    seconds, left_s = load.qpu_seconds, connection.left_on_plan_s()
    task = task.model_copy(update={"instance": connection.crn, "planned_jobs": load.jobs})
    click.echo(
        f"{task.backend}: {plural(load.jobs, 'job')}, {load.executions:,} executions, "
        f"about {seconds:.1f} QPU seconds by IBM's estimate; the limit is {live.max_qpu_seconds:g}."
        + ("" if left_s is None else f" The plan has {left_s:,.0f} s left."),
        err=True,
    )
    if seconds + 1 > live.max_qpu_seconds:  # IBM cuts jobs off at whole seconds
        raise BudgetError(
            f"The run needs {seconds:.1f} QPU seconds and one to spare, more than the "
            f"{live.max_qpu_seconds:g} allowed. Nothing was sent.",
            "Raise --max-qpu-seconds, or take fewer shots, episodes or steps; "
            "`qcompile plan` shows cheaper ways.",
        )
    if left_s is not None and seconds > left_s:
        raise BudgetError(
            f"The run needs {seconds:.1f} QPU seconds, IBM's plan has {left_s:.0f} left: its jobs "
            "would wait in the queue. Nothing was sent.",
            f"The Open Plan gives {FREE_SECONDS:g} in 28 days; --instance names another instance.",
        )
    if not live.yes:
        confirm("Spend them?")
    with begin(live.runs, task, live.max_qpu_seconds) as journal:
        return follow(journal, live.max_wait_s)


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


def follow(
    journal: Any, max_wait_s: float | None, out: Path | None = None, pay_again: bool = False
) -> dict[str, Any]:
    """Go on with a run, showing how far it is; what it found."""
    from qcompile.live.looking import doubts_in_words
    from qcompile.live.perform import go_on, task_of
    from qcompile.report.progress import progress_bar

    task = task_of(journal)
    click.echo(f"run {journal.id}", err=True)
    with progress_bar(task.name, task.planned_jobs) as show:
        result = go_on(journal, max_wait_s=max_wait_s, pay_again=pay_again, out=out, show=show)
    for line in doubts_in_words(journal):
        click.echo(line, err=True)
    return result
