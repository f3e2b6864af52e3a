"""Start a live run, and resume it until it is finished."""

from __future__ import annotations

import platform
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from qcompile.errors import (
    BudgetError,
    LiveError,
    MissingExtraError,
    OutputError,
    PaidFailureError,
    QcompileError,
    ReplayError,
)
from qcompile.live.commands import export_command, resume_command
from qcompile.live.connection import Connection
from qcompile.live.home import here, is_same_place
from qcompile.live.jobs import Jobs
from qcompile.live.journal import Journal, TaskKind
from qcompile.live.measure import CalibrateTask
from qcompile.live.play import RunTask
from qcompile.live.progress import Remaining
from qcompile.live.results import check_result
from qcompile.live.sampling import SamplerTask
from qcompile.live.task import Context, Task
from qcompile.live.validate import ValidateTask
from qcompile.terminal import one_line
from qcompile.validation import explain
from qcompile.version import versions

TASKS: dict[TaskKind, type[Task]] = {
    task.kind: task for task in (RunTask, CalibrateTask, ValidateTask, SamplerTask)
}
_PACKAGES = ("numpy", "gymnasium", "qiskit", "qiskit-ibm-runtime")


def begin(runs: Path, task: Task, max_qpu_seconds: float) -> Journal:
    """The journal of a new run, in its own folder in `runs`; nothing is sent yet.

    Raises:
        LiveError: the folder cannot be created.
    """
    settings = task.model_dump(mode="json")
    return Journal.create(runs, task.kind, task.name, settings, run_versions(), max_qpu_seconds)


def task_of(journal: Journal) -> Task:
    """The task that the run performs.

    Raises:
        LiveError: this version cannot read the task in the journal.
    """
    try:
        return TASKS[journal.kind].model_validate(journal.settings)
    except (KeyError, ValidationError) as error:
        raise LiveError(
            f"This version of qcompile cannot read {journal.path}.",
            *_why(error),
        ) from error


def complete(
    journal: Journal,
    *,
    max_wait_s: float | None = None,
    pay_again: bool = False,
    jobs_per_minute: int | None = None,
    out: Path | None = None,
    show: Callable[[float, str], None] = lambda done, words: None,
    note: Callable[[str], None] = lambda words: None,
) -> dict[str, Any]:
    """Finish the run; return its result, with its id and its charges.

    `show` gets the number of jobs done and a message; `note` gets messages that a person should
    read. A finished run returns its result again, after asking IBM once more for its jobs and
    charges; if these were all known, it does not wait for an answer. For a sampler, the jobs that
    were sent are fetched. `pay_again` sends jobs again that were charged and returned no counts. At
    most `jobs_per_minute` jobs are sent, by default the number it began with. `out` is a different
    file for a calibration; without it none is written if the run began on another machine.

    Raises:
        BudgetError: the limit of QPU seconds would be exceeded.
        LiveError: a job's counts cannot be obtained, or Ctrl-C was pressed; the same call resumes
            from there. Or the run was last resumed elsewhere (`resume_warning`): call
            `journal.move_here()` first.
        PaidFailureError: a job was charged and returned no counts, without `pay_again`.
        ReplayError: the run does not repeat what the journal recorded.
    """
    task = task_of(journal)
    if journal.result is None and (words := resume_warning(journal)):
        raise LiveError(words, f"`{resume_command(journal)}` asks whether to resume it here.")
    with journal.locked():
        step = ""

        def say(words: str) -> None:
            done = journal.jobs_done()
            spent = f"{jobs.budget.spent_s:.0f} of {jobs.budget.limit_s:g} QPU s"
            show(done, ", ".join(filter(None, (step, words, spent, remaining.words(done)))))

        def say_step(words: str) -> None:
            nonlocal step
            step = words
            say("")

        is_settled = journal.result is not None and journal.charges.are_settled
        connection = Connection(
            task.backend, task.account, task.instance, patience_s=0 if is_settled else None, say=say
        )
        jobs = Jobs(
            journal,
            connection,
            batch=task.batch,
            max_wait_s=max_wait_s,
            pay_again=pay_again,
            jobs_per_minute=jobs_per_minute or task.jobs_per_minute,
            say=say,
        )
        remaining = Remaining(task.planned_jobs, journal.jobs_done(), jobs.pace.job_s)
        if journal.result is None:
            try:
                outcome = task.perform(Context(jobs, say_step, note))
                if task.ends:
                    journal.finish(outcome)
            except KeyboardInterrupt:
                raise with_advice(LiveError("Interrupted."), journal) from None
            except QcompileError as error:
                raise with_advice(error, journal) from error
            finally:
                jobs.close()
        with suppress(KeyboardInterrupt, MissingExtraError):
            jobs.settle()
        if is_from_another_machine(journal):
            task = task.without_file()
        result = finished(journal) if task.ends else outcome | costs(journal)
        try:
            return task.deliver(result, out)
        except OutputError as error:
            command = f"`{resume_command(journal)} --out FILE`"
            hint = f"The calibration is kept: {command} writes it elsewhere."
            raise error.with_hints(hint) from error


def _why(error: Exception) -> list[str]:
    """The first faults in a journal's contents, shortened: names in it may be of any length."""
    return [one_line(line, 120) for line in explain(error, 2)]


def resume_warning(journal: Journal) -> str:
    """Why the run should not be resumed here without asking; empty at its home."""
    last, now = journal.home("last"), here(journal.id, journal.folder)
    if is_same_place(last, now):
        return ""
    if last is None:
        return f"The journal of run {journal.id} does not say where it was last resumed."
    where = "in another folder" if last.machine == now.machine else "on another machine"
    words = f"Run {journal.id} was last resumed {where}"
    if last.process is None:
        return f"{words}: another copy of it may exist."
    return f"{words} and may still be running there, as process {last.process}."


def is_from_another_machine(journal: Journal) -> bool:
    """Whether the run began on another or an unknown machine, with foreign limit and files."""
    began = journal.home("began")
    return began is None or began.machine != here(journal.id, journal.folder).machine


def costs(journal: Journal) -> dict[str, Any]:
    """The id of a run and its costs so far, as plain values.

    `qpu_seconds` is never less than IBM has charged: jobs without a reported charge, and jobs in
    doubt, count with their caps. `qpu_seconds_settled` is the total that IBM has reported.
    """
    charges = journal.charges
    return {
        "run": journal.id,
        "qpu_seconds": charges.upper_s,
        "qpu_seconds_settled": charges.settled_s,
        "jobs_uncharged": len(charges.uncharged()),
        "jobs_in_doubt": len(charges.doubts()),
        "max_qpu_seconds": journal.max_qpu_seconds,
    }


def finished(journal: Journal) -> dict[str, Any]:
    """The result of a finished run, with its `costs`.

    Raises:
        LiveError: the result is damaged.
    """
    result = journal.result or {}
    try:
        check_result(journal.kind, result)
    except ValueError as error:
        raise LiveError(
            f"{journal.path} is damaged: its result is not valid.",
            *_why(error),
            f"`{export_command(journal)}` saves the measurements.",
        ) from error
    return {**result, **costs(journal)}


def describe_progress(journal: Journal) -> str:
    """One line with the jobs and steps of the run so far."""
    steps = f", steps played: {len(journal.steps)}" if journal.kind == "run" else ""
    return f"Jobs done: {journal.jobs_done()}{steps}; everything is kept."


def run_versions() -> dict[str, str]:
    """The versions that a run must be replayed with."""
    return versions(*_PACKAGES) | {"machine": platform.machine()}


def with_advice(error: QcompileError, journal: Journal) -> QcompileError:
    """The error, with the state of the run and advice on what to do."""
    export = f"`{export_command(journal)}` saves the measurements."
    if isinstance(error, ReplayError):
        now = run_versions()
        changed = [
            f"{one_line(name, 40)} {one_line(then, 40)}, now {now.get(name)}"
            for name, then in journal.versions.items()
            if now.get(name) != then
        ]
        began = (
            f"It began with {'; '.join(changed[:6])}." if changed else "The versions are the same."
        )
        return error.with_hints(began, *_another_journal(journal), export)
    if journal.kind == "sampler":
        return error.with_hints(*_hints_for_a_program(error, journal))
    if isinstance(error, BudgetError):
        hint = f"`{resume_command(journal)} --max-qpu-seconds S` resumes it with a higher limit."
    elif isinstance(error, PaidFailureError):
        hint = f"`{resume_command(journal)} --yes` sends it again."
    elif isinstance(error, LiveError):
        hint = f"`{resume_command(journal)}` resumes it."
    else:
        hint = export
    return error.with_hints(describe_progress(journal), hint)


def _another_journal(journal: Journal) -> list[str]:
    if journal.kind != "sampler":
        return []
    return ["A journal belongs to one program, which must request the same PUBs in the same order."]


def _hints_for_a_program(error: QcompileError, journal: Journal) -> list[str]:
    """Advice on an error of a sampler, whose jobs a program requests."""
    if isinstance(error, BudgetError):
        hint = "Run the same program again with a higher max_qpu_seconds."
    elif isinstance(error, PaidFailureError):
        hint = "Run the same program again with pay_again=True to send it again."
    elif isinstance(error, LiveError):
        hint = "Run the same program again: it reads the recorded jobs and resumes."
    else:
        return []
    return [describe_progress(journal), hint]
