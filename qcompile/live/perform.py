"""Begin a live run, and resume it until it is finished."""

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
    """The journal of a new run, in a folder of its own below `runs`; nothing is sent yet.

    Raises:
        LiveError: the folder cannot be made.
    """
    settings = task.model_dump(mode="json")
    return Journal.create(runs, task.kind, task.name, settings, run_versions(), max_qpu_seconds)


def task_of(journal: Journal) -> Task:
    """What the run is to do.

    Raises:
        LiveError: the journal holds what this version cannot read.
    """
    try:
        return TASKS[journal.kind].model_validate(journal.settings)
    except (KeyError, ValidationError) as error:
        raise LiveError(
            f"{journal.path} cannot be read by this version of qcompile.",
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
    """Do what is left of the run; what it found, with its id and what was charged.

    `show` gets how many jobs are done, and words, `note` what a person should read. A finished run
    gives its result again, and asks IBM once more what it has of the run and charges for it; where
    all of that was known, it does not wait for an answer. Of a sampler those jobs are fetched that
    were sent. `pay_again` sends a job again that was charged and gave no counts. `jobs_per_minute`
    are sent at most, by default as many as it began with. `out` is another file for a calibration
    than the
    one it has; without it none is written where the run began on another machine.

    Raises:
        BudgetError: the limit of QPU seconds would be passed.
        LiveError: a job cannot be had, or Ctrl-C; the same call resumes from there. Or the run is
            not at home here (`resume_warning`): `journal.move_here()` first.
        PaidFailureError: a job was charged and gave no counts, and `pay_again` is not said.
        ReplayError: the run does not repeat what the journal holds.
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
                found = task.perform(Context(jobs, say_step, note))
                if task.ends:
                    journal.finish(found)
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
        result = finished(journal) if task.ends else found | costs(journal)
        try:
            return task.deliver(result, out)
        except OutputError as error:
            command = f"`{resume_command(journal)} --out FILE`"
            hint = f"It is measured and kept: {command} writes it elsewhere."
            raise error.with_hints(hint) from error


def _why(error: Exception) -> list[str]:
    """The first faults of a journal's contents, whose names may be of any length."""
    return [one_line(line, 120) for line in explain(error, 2)]


def resume_warning(journal: Journal) -> str:
    """Why the run should not be resumed here unasked, in words; empty where it is at home."""
    last, now = journal.home("last"), here(journal.id, journal.folder)
    if is_same_place(last, now):
        return ""
    if last is None:
        return f"Run {journal.id} does not say on which machine it was resumed last."
    where = "in another folder" if last.machine == now.machine else "on another machine"
    words = f"Run {journal.id} was last resumed {where}"
    if last.process is None:
        return f"{words}: there may be another copy of it."
    return f"{words} and may still be running there, as process {last.process}."


def is_from_another_machine(journal: Journal) -> bool:
    """Whether another machine made the journal, or one that is not known: its limit and its files
    are somebody else's word."""
    began = journal.home("began")
    return began is None or began.machine != here(journal.id, journal.folder).machine


def costs(journal: Journal) -> dict[str, Any]:
    """The id of a run, and what it costs up to now, as plain values.

    `qpu_seconds` is never less than what IBM has charged: jobs of which IBM has not said it, and
    jobs in doubt, count with their caps. `qpu_seconds_settled` is what IBM has said so far.
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
    """What a finished run found, with its `costs`.

    Raises:
        LiveError: the result is damaged.
    """
    result = journal.result or {}
    try:
        check_result(journal.kind, result)
    except ValueError as error:
        raise LiveError(
            f"{journal.path} is damaged: its result is wrong.",
            *_why(error),
            f"`{export_command(journal)}` gives what was measured.",
        ) from error
    return {**result, **costs(journal)}


def describe_progress(journal: Journal) -> str:
    """A line of words: jobs and steps of the run so far."""
    steps = f", steps played: {len(journal.steps)}" if journal.kind == "run" else ""
    return f"Jobs done: {journal.jobs_done()}{steps}; all of it is kept."


def run_versions() -> dict[str, str]:
    """What a run has to be played again with."""
    return versions(*_PACKAGES) | {"machine": platform.machine()}


def with_advice(error: QcompileError, journal: Journal) -> QcompileError:
    """The error, with where the run stands and what to do."""
    export = f"`{export_command(journal)}` gives what was measured."
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
        hint = f"`{resume_command(journal)} --max-qpu-seconds S` resumes it with more."
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
    return ["A journal is of one program, which asks for the same PUBs in the same order."]


def _hints_for_a_program(error: QcompileError, journal: Journal) -> list[str]:
    """What to do about an error of a sampler's, whose jobs a program asks for."""
    if isinstance(error, BudgetError):
        hint = "Run the same program again with a higher max_qpu_seconds."
    elif isinstance(error, PaidFailureError):
        hint = "Run the same program again with pay_again=True: it sends it again."
    elif isinstance(error, LiveError):
        hint = "Run the same program again: it gets what is recorded, and goes on."
    else:
        return []
    return [describe_progress(journal), hint]
