"""Begin a live run, and go on with it until it is finished."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from qcompile.errors import LiveError, QcompileError
from qcompile.live.budget import Budget, where_it_stands
from qcompile.live.connection import Connection
from qcompile.live.jobs import Jobs
from qcompile.live.journal import Journal, Kind
from qcompile.live.measure import CalibrateTask
from qcompile.live.play import RunTask
from qcompile.live.task import Session, Task
from qcompile.live.validate import ValidateTask
from qcompile.output import write_file
from qcompile.validation import explain

TASKS: dict[Kind, type[Task]] = {task.kind: task for task in (RunTask, CalibrateTask, ValidateTask)}


def begin(runs: Path, task: Task, max_qpu_seconds: float) -> Journal:
    """The journal of a new run, in a folder of its own below `runs`; nothing is sent yet.

    Raises:
        LiveError: the folder cannot be made.
    """
    settings = task.model_dump(mode="json")
    return Journal.create(runs, task.kind, task.name, settings, max_qpu_seconds)


def task_of(journal: Journal) -> Task:
    """What the run is to do.

    Raises:
        LiveError: the journal holds what this version cannot read.
    """
    try:
        return TASKS[journal.kind].model_validate(journal.settings)
    except (KeyError, ValidationError) as error:
        raise LiveError(
            f"Run {journal.id} cannot be read by this version of qcompile.", *explain(error)
        ) from error


def go_on(
    journal: Journal,
    *,
    max_wait_s: float | None = None,
    show: Callable[[float, str], None] = lambda done, words: None,
) -> dict[str, Any]:
    """Do what is left of the run; what it found, with its id and what was charged.

    `show` gets how much is done, and words. A finished run gives its result again.

    Raises:
        BudgetError: the limit of QPU seconds would be passed.
        LiveError: a job cannot be had, or Ctrl-C; the same call goes on from there.
    """
    with journal.held():
        if journal.result is not None:
            return journal.result
        task, budget = task_of(journal), Budget(journal)
        done = 0.0

        def shown(now: float, words: str) -> None:
            nonlocal done
            done = now
            say(words)

        def say(words: str) -> None:
            show(done, f"{words}; {budget.spent_s():.0f} of {budget.limit_s:g} QPU s")

        connection = Connection(task.backend, task.account, task.instance)
        jobs = Jobs(journal, connection, batch=task.batch, max_wait_s=max_wait_s, say=say)
        try:
            found = task.perform(Session(jobs, shown))
            jobs.learn_charges()
        except KeyboardInterrupt:
            raise LiveError(
                "Interrupted.", where_it_stands(journal), f"`qcompile resume {journal.id}` goes on."
            ) from None
        except QcompileError as error:
            if "resume" in str(error):
                raise
            hint = f"`qcompile resume {journal.id}` goes on."
            raise type(error)(str(error), where_it_stands(journal), hint) from error
        finally:
            jobs.close()
        charges = {"qpu_seconds": budget.spent_s(), "max_qpu_seconds": budget.limit_s}
        result = {**found, "run": journal.id, **charges}
        journal.finish(result)
        write_file(journal.folder / "result.json", json.dumps(result, indent=1).encode() + b"\n")
        return result
