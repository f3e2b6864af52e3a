"""Live runs on IBM machines: the user's limits, and the check before anything is spent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qcompile.caller import option
from qcompile.errors import BudgetError, OptionError
from qcompile.execution import Workload
from qcompile.limits import FREE_SECONDS, MAX_QPU_SECONDS
from qcompile.live.connection import Connection
from qcompile.live.finder import describe_doubts
from qcompile.live.journal import Journal
from qcompile.live.pace import check_pace, check_seconds
from qcompile.live.perform import begin, complete, task_of
from qcompile.live.task import Task
from qcompile.report import progress as bars
from qcompile.report.tables import plural
from qcompile.sweep.arguments import Name, Words, ignore


@dataclass(frozen=True)
class Live:
    """Options of a run on IBM hardware, which costs money.

    `max_qpu_seconds` is the most QPU time to use: the run stops before it would exceed it.
    `account` is the name of an account saved with qiskit-ibm-runtime, `instance` the CRN or name of
    an IBM instance; the defaults are those of qiskit-ibm-runtime. With `batch` the jobs are sent as
    one IBM batch. At most `jobs_per_minute` are sent a minute, for accounts with a rate limit.
    `runs` is the folder that records live runs. The run stops waiting for a job after `max_wait_s`;
    `qcompile resume` fetches it later. `confirm` is called with a question before anything is
    spent, and raises an error if the answer is no.

    Raises:
        OptionError: a number of seconds or jobs is not a number, or out of range.
    """

    max_qpu_seconds: float
    account: str | None = None
    instance: str | None = None
    batch: bool = False
    jobs_per_minute: int | None = None
    runs: Name = "runs"
    max_wait_s: float | None = None
    confirm: Words = ignore

    def __post_init__(self) -> None:
        check_seconds("max_qpu_seconds", self.max_qpu_seconds, MAX_QPU_SECONDS)
        check_pace(self.jobs_per_minute, self.max_wait_s)

    @property
    def where(self) -> dict[str, Any]:
        """The fields of a task that say where and how its jobs are sent."""
        return {
            "account": self.account,
            "instance": self.instance,
            "batch": self.batch,
            "jobs_per_minute": self.jobs_per_minute,
        }

    def connection(self, backend: str) -> Connection:
        """A connection to the machine of that name."""
        return Connection(backend, self.account, self.instance)


def check_live(live: object) -> None:
    """Check that `live` is a `Live`, or None.

    Raises:
        OptionError: it is something else.
    """
    if not isinstance(live, Live | None):
        raise OptionError(
            f"live is {live!r}, not a qcompile.Live.",
            "Set the limit, such as live=qcompile.Live(max_qpu_seconds=25).",
        )


def spend(
    task: Task,
    load: Workload,
    live: Live,
    connection: Connection,
    on_note: Words,
) -> dict[str, Any]:
    """Show what the task costs, ask for confirmation, run it, and return its result.

    The run uses the instance through which the connection reaches the backend.

    Raises:
        BudgetError: the task needs more QPU time than the limit or the plan allows.
        LiveError: it cannot be started or resumed.
    """
    seconds, left_s = load.qpu_seconds, connection.left_on_plan_s()
    task = task.model_copy(update={"instance": connection.crn, "planned_jobs": load.jobs})
    on_note(
        f"{task.backend}: {plural(load.jobs, 'job')}, {load.executions:,} executions, "
        f"about {seconds:.1f} QPU seconds by IBM's estimate; the limit is {live.max_qpu_seconds:g}."
        + ("" if left_s is None else f" The plan has {left_s:,.0f} s left.")
    )
    if seconds + 1 > live.max_qpu_seconds:  # IBM cuts jobs off at whole seconds
        raise BudgetError(
            f"The run needs {seconds:.1f} QPU seconds and 1 in reserve, more than the limit of "
            f"{live.max_qpu_seconds:g}. Nothing was sent.",
            f"Raise {option('max_qpu_seconds')}, or use fewer shots, episodes or steps. "
            "`qcompile plan --within SECONDS` finds cheaper settings.",
        )
    if left_s is not None and seconds > left_s:
        raise BudgetError(
            f"The run needs {seconds:.1f} QPU seconds, but IBM's plan has only {left_s:.0f} left: "
            "its jobs would stay in the queue. Nothing was sent.",
            f"The Open Plan gives {FREE_SECONDS:g} in 28 days. To use another instance, add "
            f"{option('instance')}.",
        )
    live.confirm("Spend this QPU time?")
    with begin(Path(live.runs), task, live.max_qpu_seconds) as journal:
        return follow(journal, live.max_wait_s, on_note)


def follow(
    journal: Journal,
    max_wait_s: float | None,
    on_note: Words,
    *,
    out: Path | None = None,
    pay_again: bool = False,
    jobs_per_minute: int | None = None,
) -> dict[str, Any]:
    """Resume a run, show its progress, and return its result."""
    task = task_of(journal)
    on_note(f"run {journal.id}")
    with bars.progress_bar(task.name, task.planned_jobs, estimates=False) as show:
        result = complete(
            journal,
            max_wait_s=max_wait_s,
            pay_again=pay_again,
            jobs_per_minute=jobs_per_minute,
            out=out,
            show=show,
            note=on_note,
        )
    for line in describe_doubts(journal):
        on_note(line)
    return result
