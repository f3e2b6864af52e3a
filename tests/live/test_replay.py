"""A run played again from its journal: it asks nobody, and believes nothing that does not fit."""

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

from qcompile.live.journal import find_journal


def change(what: str, *values: object) -> None:
    """Change the journal of the only run, and have it played again."""
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
    assert runs.service.ledger() == before
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
    journal = find_journal(Path("runs"), "last")
    settings = dict(journal.settings)
    if part == "policy":
        settings["policy"]["theta"][0] += 1e-9
    else:
        settings[part] = {"shots": 255, "level": 1}[part]
    before = runs.service.ledger()
    change("UPDATE run SET settings = ?", json.dumps(settings))
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert answer.err.split("Error: ")[1] == (
        f"Job 0 of run {journal.id} was another one when it was sent.\n"
        "  The versions of qcompile, numpy and gymnasium must be those it began with.\n"
        f"  `qcompile runs export {journal.id}` gives what was measured.\n"
        "  3 jobs are done, 3 steps are played; all of it is kept.\n"
        f"  `qcompile resume {journal.id}` goes on.\n"
    )
    assert runs.service.ledger() == before


def flip(actions: Any) -> None:
    actions[0] = 1 - actions[0]


def test_recorded_actions_are_taken(runs: Runs) -> None:
    """An episode that was pushed the other way is seen in the next observation."""
    runs.run()
    changed_array("actions", 0, flip)
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert "The observations of step 1 are not those recorded" in answer.err


def nudge(values: Any) -> None:
    values.flat[0] = np.nextafter(values.flat[0], np.inf)


@pytest.mark.parametrize("column", ["observations", "rewards"])
def test_what_the_environment_shows_is_checked_to_the_last_bit(runs: Runs, column: str) -> None:
    runs.run()
    changed_array(column, 1, nudge)
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert (
        f"The {column} of step 1 are not those recorded: the environment does not repeat itself."
    ) in answer.err
    assert "must be those the run began with" in answer.err


def test_counts_of_the_journal_are_what_actions_come_from(
    runs: Runs, undisturbed: dict[str, Any]
) -> None:
    """With the last step and its counts gone, the run is played on to the same end.

    Its job is found by its tag, and not paid again.
    """
    runs.run()
    change("DELETE FROM step WHERE number = 2")
    change("UPDATE submission SET state = 'intended', job_id = NULL, ones = NULL WHERE number = 2")
    answer = runs.call("resume", "last", "--json")
    assert played(answer.json()) == undisturbed
    check_paid_once(runs.service, 3)
