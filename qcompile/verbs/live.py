"""Runs on IBM's machines: what a user allows of one, and the guard that each passes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
    """What is allowed and wanted of a run on a real machine; this spends.

    The run stops before it would take more than `max_qpu_seconds`. `account` and `instance` are
    names of IBM's own tools, by default theirs. With `batch` jobs go as a batch of IBM's; at most
    `jobs_per_minute` of them are sent in a minute, for accounts that may send no more. `runs` is
    the folder of the journals; after `max_wait_s` a job is not waited for any longer, and
    `qcompile resume` fetches it. `confirm` is asked before anything is spent, and raises where the
    answer is no.

    Raises:
        OptionError: a number of seconds or jobs that is none, or out of range.
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
        """The fields of a task that say where and how it is sent."""
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
    """Nothing, if `live` allows a run on a machine, or is None.

    Raises:
        OptionError: it is something else.
    """
    if not isinstance(live, Live | None):
        raise OptionError(
            f"live is {live!r}, not a qcompile.Live.",
            "It says what may be spent: live=qcompile.Live(max_qpu_seconds=25).",
        )


def spend(
    task: Task,
    load: Workload,
    live: Live,
    connection: Connection,
    on_note: Words,
) -> dict[str, Any]:
    """Tell what the task costs, have it confirmed, and do it; what it found.

    The run keeps to the instance by which the connection reaches the backend.

    Raises:
        BudgetError: the task needs more than it is allowed.
        LiveError: it cannot start or resume.
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
    live.confirm("Spend them?")
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
    """Resume a run, showing how far it is; what it found."""
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
