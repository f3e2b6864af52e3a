"""Everything recorded is on the disk before a run continues; its files are where requested."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import pytest
from live_runs import Runs

from qcompile.calibration import load_calibration

FULL = 2
"""SQLite waits for the disk at each write: https://sqlite.org/pragma.html#pragma_synchronous"""


def test_every_write_of_a_run_waits_for_the_disk(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever connection writes a submission does so with synchronous = FULL, or EXTRA."""
    real, seen = sqlite3.connect, []

    class Watched(sqlite3.Connection):
        def execute(self, statement: str, *values: Any) -> sqlite3.Cursor:
            if statement.split()[0].upper() in ("INSERT", "UPDATE", "DELETE"):
                level = super().execute("PRAGMA synchronous").fetchone()[0]
                seen.append((level, statement))
            return super().execute(statement, *values)

    def connect(*args: Any, **options: Any) -> Any:
        return real(*args, **{"factory": Watched} | options)

    monkeypatch.setattr(sqlite3, "connect", connect)
    assert runs.run().code == 0
    assert len(seen) > 10
    assert [statement for level, statement in seen if level < FULL] == []


@pytest.mark.parametrize("force", [False, True])
def test_a_calibration_overwrites_a_file_with_force_alone(runs: Runs, force: bool) -> None:
    """A file that appeared during the run is not overwritten without --force."""
    words = ("calibrate", "--backend", "fake_lima", "--shots", 100, "--out", "machine.json")
    live = ("--live", "--max-qpu-seconds", 100, "--yes", "--max-wait-seconds", 0.05)
    runs.service.settings.queue_seconds = 0.3
    assert runs.call(*words, *live, *["--force"] * force).code == 1
    Path("machine.json").write_text("paid for")
    answer = runs.call("resume", "last", "--json", "--yes")
    assert answer.code == 0, answer.err
    file = Path(answer.json()["file"])
    assert load_calibration(file).backend == "fake_lima"
    assert (file.name == "machine.json") == force
    assert (Path("machine.json").read_text() == "paid for") == (not force)
