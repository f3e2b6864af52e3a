"""Live runs as plain values, and printed on the terminal."""

from __future__ import annotations

import textwrap
from base64 import b64encode
from collections.abc import Mapping
from typing import Any

import click
from numpy.typing import NDArray

from qcompile.calibration import Calibration
from qcompile.execution.packed import ones_of_bits
from qcompile.live.commands import resume_command
from qcompile.live.finder import describe_doubts
from qcompile.live.journal import Journal, TaskKind
from qcompile.live.journal_file import reading
from qcompile.live.perform import costs, describe_progress, task_of
from qcompile.live.records import State, Submission
from qcompile.mitigation.misfit import misfit_warnings
from qcompile.report.calibration_values import calibration_values, limit_words, print_calibration
from qcompile.report.summary import print_run
from qcompile.report.tables import cost_in_words, plural, print_table
from qcompile.terminal import one_line

_HOW_TO_CONTINUE = "To continue, run its program again."


def overview(journal: Journal) -> dict[str, Any]:
    """A run in a few plain values, with its cost so far."""
    states = journal.states()
    return {
        "run": journal.id,
        "kind": journal.kind,
        "backend": journal.settings.get("backend"),
        "created": journal.created.isoformat(),
        "state": _state(journal, states),
        "jobs_done": states.get("done", 0),
        "jobs_open": states.get("sending", 0) + states.get("sent", 0),
        "steps": len(journal.steps),
        **costs(journal),
    }


def _state(journal: Journal, states: dict[State, int]) -> str:
    """The state in one word; a sampler is finished if it has the results of all jobs sent."""
    if journal.kind == "sampler":
        is_finished = not any(states.get(state) for state in ("sending", "sent"))
    else:
        is_finished = journal.result is not None
    return "finished" if is_finished else "unfinished"


def exported(journal: Journal) -> dict[str, Any]:
    """The whole record of a run as plain values."""
    jobs = [
        {
            "number": submission.number,
            "attempt": submission.attempt,
            "tag": submission.tag,
            "job_id": submission.job_id,
            "state": submission.state,
            "sent_at": submission.sent_at.isoformat() if submission.sent_at else None,
            "executions": submission.executions,
            "qpu_seconds": submission.charged_s,
            "ones": None if submission.ones is None else submission.ones.tolist(),
            "measured": _measured(journal, submission),
            "words": submission.words,
        }
        for submission in journal.submissions()
    ]
    steps = [
        {
            "observations": step.observations.tolist(),
            **({} if step.chains is None else _lists(vars(step.chains))),
            **_lists({"actions": step.actions, "rewards": step.rewards}),
        }
        for step in journal.steps
    ]
    return {
        **overview(journal),
        "versions": journal.versions,
        "settings": journal.settings,
        "jobs": jobs,
        "steps": steps,
        "result": journal.result,
    }


def _lists(arrays: Mapping[str, NDArray[Any] | None]) -> dict[str, Any]:
    """Arrays by name as lists; None stays None."""
    return {name: None if array is None else array.tolist() for name, array in arrays.items()}


def _measured(journal: Journal, submission: Submission) -> list[dict[str, Any]] | None:
    """The measured bits of a job as base64, and the ones of each bit, for each PUB and register.

    Jobs of earlier versions have `ones` instead.
    """
    if submission.state != "done" or submission.ones is not None:
        return None
    values = []
    for register in journal.measured.of(submission.number):
        with reading(journal.path):
            packed = register.bits
        values.append(
            {
                "pub": register.pub,
                "register": register.name,
                "shape": register.shape,
                "bits": register.width,
                "packed": b64encode(packed.tobytes()).decode(),
                "ones": ones_of_bits(packed, register.width).tolist(),
            }
        )
    return values


def result_values(kind: TaskKind, result: dict[str, Any]) -> dict[str, Any]:
    """The --json document of the command that started the run."""
    if kind != "calibrate":
        return result
    others = {name: value for name, value in result.items() if name != "calibration"}
    return calibration_values(Calibration.model_validate(result["calibration"])) | others


def terms(journal: Journal, limit_s: float) -> str:
    """A sentence on what resuming the run would do: the machine, the account and the limit.

    Raises:
        LiveError: its settings cannot be read.
    """
    task = task_of(journal)
    account = "the default account" if task.account is None else f"account {one_line(task.account)}"
    instance = "" if task.instance is None else f", instance {one_line(task.instance)}"
    charged_s = costs(journal)["qpu_seconds"]
    return (
        f"It would run on {one_line(task.backend)} with {account}{instance}, "
        f"with a limit of {limit_s:g} QPU seconds, of which up to {charged_s:.1f} are used."
    )


def print_overview(journal: Journal) -> None:
    """Print the progress of an unfinished run."""
    row = overview(journal)
    backend = one_line(str(row["backend"]))
    click.echo(f"{row['run']}, {row['kind']} on {backend}: {row['state']}")
    click.echo(describe_progress(journal))
    click.echo(f"{cost_in_words(row)}; the limit is {row['max_qpu_seconds']:g}")
    for line in describe_doubts(journal):
        click.echo(line)
    if journal.kind == "sampler":
        click.echo(f"{_HOW_TO_CONTINUE} `{resume_command(journal)}` fetches the jobs sent.")
    else:
        click.echo(f"`{resume_command(journal)}` resumes it.")


def print_result(kind: TaskKind, result: dict[str, Any]) -> None:
    """Print the result of a finished run."""
    if kind == "run":
        print_run(result)
        return
    if kind == "validate":
        print_validation(result)
    elif kind == "sampler":
        jobs = plural(result["jobs_done"], "job")
        click.echo(f"{one_line(str(result['backend']))}: {jobs} done, {result['jobs_open']} open")
        click.echo(_HOW_TO_CONTINUE)
    else:
        print_calibration(result_values(kind, result))
        if result.get("file"):
            click.echo(f"calibration written to {result['file']}")
    click.echo(charged(result))


def print_validation(check: dict[str, Any]) -> None:
    """Print the result of a validation, a row for each qubit."""
    columns = ["qubits", "chi_square", "degrees", "p_value", *["power"] * ("power" in check)]
    print_table(
        ["qubit", "chi-square", "expected", "p-value", *["power"] * ("power" in check), ""],
        [
            [*row, "fails" if row[0] in check["failed"] else "holds"]
            for row in zip(*(check[column] for column in columns), strict=True)
        ],
        f"Twin of {check['file']} against fresh counts, {check['shots']} shots",
    )
    click.echo(textwrap.fill(limit_words(len(check["qubits"])), 80, subsequent_indent="  "))
    if "power" in check:
        click.echo(
            f"{plural(check['observations'], 'observation')}: an increase of p01 by "
            f"{check['effect']:g} on any one qubit is detected with a probability of at least "
            f"{100 * check['least_power']:.0f} %"
        )
        for words in misfit_warnings(check["calibration_misfits"]):
            click.echo(words)
    verdict = "pass" if check["passed"] else "fail"
    click.echo(f"{verdict}; the largest difference in <Z> is {check['largest_difference']:.3f}")


def charged(result: dict[str, Any]) -> str:
    """A line with the cost of a finished run."""
    return f"run {result['run']}: {cost_in_words(result)}"
