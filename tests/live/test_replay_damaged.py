"""A journal whose arrays fit neither its jobs nor its steps is explained when it is resumed."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from live_runs import Runs

from qcompile.live.records import to_bytes
from qcompile.live.runs import find_journal

COUNTS, ACTIONS = "the counts of a job are not valid", "the actions of step 1 are not valid"


@pytest.mark.parametrize(
    ("table", "column", "value", "words"),
    [
        ("measured", "packed", None, COUNTS),
        ("measured", "packed", b"", COUNTS),
        ("measured", "packed", bytes(511), COUNTS),
        ("measured", "shape", "[2, 255]", COUNTS),
        ("measured", "shape", "[512]", COUNTS),
        ("measured", "width", 5, COUNTS),
        ("measured", "pub", 1, COUNTS),
        ("measured", "name", "d", COUNTS),
        ("step", "actions", to_bytes(np.array([2, 0])), ACTIONS),
        ("step", "actions", to_bytes(np.array([0, -1])), ACTIONS),
        ("step", "actions", to_bytes(np.array([1, 0, 1])), ACTIONS),
        ("step", "actions", to_bytes(np.array([0.5, np.nan])), ACTIONS),
    ],
)
def test_an_array_that_cannot_be(
    runs: Runs, table: str, column: str, value: object, words: str
) -> None:
    """Of two CartPole episodes at 256 shots: bits (2, 256, 4), actions 0 and 1."""
    assert runs.run().code == 0
    with find_journal(Path("runs"), "last") as journal:
        pass
    with sqlite3.connect(journal.path) as db:
        db.execute("UPDATE run SET result = NULL")
        db.execute(f"UPDATE {table} SET {column} = ? WHERE number = 1", (value,))
    db.close()
    sent = len(runs.service.ledger().jobs)
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert f"Error: {journal.path} is damaged: {words}.\n  Restore a backup.\n" in answer.err
    assert len(runs.service.ledger().jobs) == sent
