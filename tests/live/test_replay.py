"""A run replayed from its journal: it sends no requests, and rejects whatever does not fit."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_runs import Runs, check_paid_once, played
from standin import StandIn

from qcompile.errors import ReplayError
from qcompile.execution import PrimitiveExecutor
from qcompile.ir import Circuit, Program
from qcompile.live.connection import Connection
from qcompile.live.jobs import Jobs
from qcompile.live.jobs_sampler import JobsSampler
from qcompile.live.journal import Journal
from qcompile.live.perform import run_versions
from qcompile.live.runs import find_journal
from qcompile.passes import compile


def change(what: str, *values: object) -> None:
    """Change the journal of the only run, and replay it."""
    [path] = Path("runs").glob("*/journal.sqlite")
    with sqlite3.connect(path) as db:
        db.execute(what, values)
        db.execute("UPDATE run SET result = NULL")


def changed_array(column: str, number: int, change_it: Callable[[Any], None]) -> None:
    [path] = Path("runs").glob("*/journal.sqlite")
    with sqlite3.connect(path) as db:
        row = db.execute(f"SELECT {column} FROM step WHERE number = ?", (number,)).fetchone()
    array = np.load(BytesIO(row[0]))
    change_it(array)
    file = BytesIO()
    np.save(file, array)
    change(f"UPDATE step SET {column} = ? WHERE number = ?", file.getvalue(), number)


def test_a_run_played_again_sends_nothing_and_finds_the_same(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    first = runs.run().json()
    before = runs.service.ledger()
    change("UPDATE run SET result = NULL")
    again = runs.call("resume", "last", "--json")
    assert again.code == 0, again.err
    assert played(again.json()) == played(first) == undisturbed
    assert runs.service.ledger().jobs == before.jobs
    check_paid_once(runs.service, 3)


def test_it_does_not_even_need_an_account(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    first = runs.run().json()
    change("UPDATE run SET result = NULL")
    for name in ("QISKIT_IBM_TOKEN", "QISKIT_IBM_INSTANCE", "QISKIT_IBM_URL"):
        monkeypatch.delenv(name)
    assert played(runs.call("resume", "last", "--json").json()) == played(first)


@pytest.mark.parametrize("part", ["shots", "level", "policy"])
def test_a_changed_input_is_explained_and_not_sent(runs: Runs, part: str) -> None:
    """Other shots, other gates or another parameter: the job would be another one."""
    runs.run()
    with find_journal(Path("runs"), "last") as journal:
        settings = dict(journal.settings)
    if part == "policy":
        settings["policy"]["theta"][0] += 1e-8
    else:
        settings[part] = {"shots": 255, "level": 1}[part]
    before = runs.service.ledger()
    change("UPDATE run SET settings = ?", json.dumps(settings))
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert answer.err.split("Error: ")[1] == (
        f"Job 0 of run {journal.id} differs from the one that was sent.\n"
        "  The versions are the same.\n"
        f"  `qcompile runs export {journal.id}` saves the measurements.\n"
    )
    assert runs.service.ledger() == before


def flip(actions: Any) -> None:
    actions[0] = 1 - actions[0]


def test_recorded_actions_are_taken(runs: Runs) -> None:
    """An episode that was pushed the other way differs in the next observation."""
    runs.run()
    changed_array("actions", 0, flip)
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert "The observations of step 1 differ from the recorded ones" in answer.err


@pytest.mark.parametrize(("by", "same"), [(1e-13, True), (-1e-13, True), (1e-8, False)])
def test_an_angle_that_another_processor_rounds_otherwise_is_the_same(
    service: StandIn, by: float, same: bool
) -> None:
    """0 and -0 as well: the first of them is rounded to one or the other."""
    connection = Connection("fake_lima")
    journal = Journal.create(Path("runs"), "run", "cart", {}, {}, 60.0)
    device = connection.device()
    executable = compile(Program.of([Circuit.parse("ry(x0) rz(x1)")], inputs=2), device)
    x = np.array([[0.0, 0.3], [1.1, 2.0]])

    def run(x: Any) -> Any:
        sampler = JobsSampler(Jobs(journal, connection))
        executor = PrimitiveExecutor(device, sampler=sampler, kind="hardware")
        return executor.run(executable, x, np.zeros(0), 100)

    ones = run(x)
    if same:
        assert run(x + by).tolist() == ones.tolist()
    else:
        with pytest.raises(ReplayError, match=r"Job 0 .* differs from the one that was sent"):
            run(x + by)
    assert len(service.ledger().jobs) == 1


def test_versions_that_differ_are_named(runs: Runs) -> None:
    """And those alone."""
    runs.run()
    with find_journal(Path("runs"), "last") as journal:
        was, settings = dict(journal.versions), dict(journal.settings)
    assert was == run_versions()
    assert set(was) == {
        *("machine", "qcompile", "numpy", "gymnasium", "qiskit", "qiskit-ibm-runtime")
    }
    other = was | {"numpy": "1.0.0", "machine": "abacus"}
    settings["shots"] = 255
    change(
        "UPDATE run SET settings = ?, versions = ?",
        *(json.dumps(settings), json.dumps(dict(sorted(other.items())))),
    )
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert (
        f"differs from the one that was sent.\n  It began with machine abacus, now "
        f"{was['machine']}; numpy 1.0.0, now {was['numpy']}.\n  `qcompile runs export "
    ) in answer.err


def nudge(by: float) -> Callable[[Any], None]:
    """Change the first value, by a relative and an absolute amount."""

    def change_it(values: Any) -> None:
        values.flat[0] += by * (1 + abs(values.flat[0]))

    return change_it


@pytest.mark.parametrize("column", ["observations", "rewards"])
@pytest.mark.parametrize("by", [3e-9, np.nan])
def test_what_the_environment_shows_is_checked(runs: Runs, column: str, by: float) -> None:
    runs.run()
    changed_array(column, 1, nudge(by))
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert answer.err.split("Error: ")[1].startswith(
        f"The {column} of step 1 differ from the recorded ones: the environment does "
        "not repeat itself.\n"
        "  The versions are the same.\n"
        "  `qcompile runs export "
    )


@pytest.mark.parametrize("column", ["observations", "rewards"])
def test_what_another_processor_rounds_otherwise_is_the_same(
    runs: Runs, undisturbed: dict[str, Any], column: str
) -> None:
    runs.run()
    changed_array(column, 1, nudge(1e-13))
    assert played(runs.call("resume", "last", "--json").json()) == undisturbed


def test_counts_of_the_journal_are_what_actions_come_from(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """With the last step and its counts removed, the run is played to the same end.

    Its job is found by its tag, and not paid again.
    """
    runs.run()
    change("DELETE FROM step WHERE number = 2")
    change("UPDATE measured SET packed = NULL WHERE number = 2")
    change("UPDATE submission SET state = 'sending', job_id = NULL WHERE number = 2")
    answer = runs.call("resume", "last", "--json")
    assert played(answer.json()) == undisturbed
    check_paid_once(runs.service, 3)
