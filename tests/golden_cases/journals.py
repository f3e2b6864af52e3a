"""`qcompile runs` and `resume` on journals made by hand: damaged, unknown, of other places."""

from __future__ import annotations

import platform
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filelock import Timeout
from live_runs import measured_ones

from qcompile.device import load_device
from qcompile.live.journal import Journal
from qcompile.live.play import RunTask

from .case import Command
from .inputs import policy, setting, write

RUNS = Path("runs")
RESULT = {"passed": True, "failed": [], "qubits": [3], "chi_square": [4.0], "degrees": [5],
          "p_value": [0.5], "largest_difference": 0.02, "file": "lima.json",
          "shots": 100}  # fmt: skip

DAMAGES: dict[str, tuple[str, tuple[object, ...]]] = {
    "format": ("UPDATE run SET format = 'qcompile-journal-9'", ()),
    "gone": ("DELETE FROM run", ()),
    "id": ("UPDATE run SET id = 'a b'", ()),
    "kind": ("UPDATE run SET kind = 'other'", ()),
    "created": ("UPDATE run SET created = 'soon'", ()),
    "settings": ("UPDATE run SET settings = '[]'", ()),
    "limit": ("UPDATE run SET max_qpu_seconds = 'x'", ()),
    "state": ("UPDATE submission SET state = 'paid'", ()),
    "counts": ("UPDATE measured SET packed = ?", (b"\x93NUMPY\x01\x00",)),
    "shape": ("UPDATE measured SET shape = '[100, true]'", ()),
    "earlier-counts": ("UPDATE submission SET ones = ?", (b"\x93NUMPY\x01\x00",)),
    "sent-at": ("UPDATE submission SET sent_at = 'soon'", ()),
    "charge": ("UPDATE charge SET charged_s = -1.0", ()),
    "charge-time": ("UPDATE charge SET sent_at = 'soon'", ()),
    "step": ("UPDATE step SET actions = 3", ()),
    "array": ("UPDATE step SET rewards = ?", (b"PK\x03\x04",)),
    "trigger": (
        "CREATE TRIGGER more AFTER UPDATE ON step BEGIN DELETE FROM run; END",
        (),
    ),
    "table": ("DROP TABLE submission", ()),
}


def settings() -> dict[str, Any]:
    """Those of a run of one step."""
    task = RunTask.model_validate(
        {
            "backend": "fake_lima",
            "device": load_device("fake_lima"),
            "policy": policy(),
            "shots": 100,
            "episodes": 1,
            "seed": 0,
            "level": 2,
            "mitigation": "none",
            "max_steps": 1,
        }
    )
    return task.model_dump(mode="json")


def journal(name: str, runs: Path = RUNS, kind: Any = "run", **values: Any) -> Journal:
    """A run with a job that is done and charged, one that failed, one under way, and two steps."""
    made = Journal.create(runs, kind, name, {"backend": "somewhere"} | values, {"numpy": "2"}, 9.0)
    for number, job_id in enumerate(("job-a", "job-b", "job-c")):
        made.note_sent(made.note_sending(made.intend(number, "d", 100), 3), job_id)
    made.note_done(made.attempts(0)[0], [measured_ones([[3, 97]], 100)])
    made.note_failed(made.attempts(1)[0], "it rained")
    charge = made.charges.of_job("job-a")
    assert charge is not None
    made.charges.settle(charge, 2.25)
    made.steps.note_actions(0, np.array([[0.5, -1.0]]), np.array([1]))
    made.steps.note_rewards(0, [1.0])
    made.steps.note_actions(1, np.array([[0.25, 2.0]]), np.array([0]))
    return made


def execute(made: Journal, statement: str, *values: object) -> None:
    with sqlite3.connect(made.path) as db:
        db.execute(statement, values)
    db.close()


def files() -> None:
    write({"file": "", "empty/260101-000000-cart-aaaa/journal.sqlite": ""})
    for name, (statement, values) in DAMAGES.items():
        with journal(name, Path(f"damaged-{name}")) as made:
            pass
        execute(made, statement, *values)
    with journal("noise", Path("noise")) as made:
        pass
    made.path.write_bytes(b"nothing of a database " * 300)
    journal("kept", Path("noise"))
    for name in ("alpha", "beta", "beta"):
        journal(name)
    journal("stranger", Path("strangers"), **settings())
    with journal("nowhere", Path("nowhere"), **settings()) as made:
        execute(made, "DROP TABLE home")
    with journal("going", Path("going"), **settings()) as made:
        execute(made, "UPDATE home SET process = 12345, folder = 'other' WHERE moment = 'last'")
    journal("wrong", Path("wrong"), "calibrate").finish({"calibration": {}})
    journal("checked", Path("checked"), "validate", backend="b").finish(RESULT)
    with journal("doubts", Path("doubts")) as made:
        for number in (3, 4):
            made.note_sending(made.intend(number, "d", 100), 3)
    with journal("locked", Path("locked"), **settings()) as made:
        (made.folder / "lock").mkdir()
    with journal("another", Path("another"), **settings()) as made:
        execute(made, "DELETE FROM step")
    with journal("changed", Path("changed"), **settings()) as made:
        execute(made, "UPDATE submission SET state = 'done'")


def elsewhere(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(platform, "node", lambda: "another-machine")


class Busy:
    """A lock that another process holds."""

    def __init__(self, path: Path, timeout: float):
        self.path = path

    def acquire(self) -> None:
        raise Timeout(str(self.path))


SOMEBODY = setting("qcompile.cli.live_options.is_interactive", lambda: True)

CASES = (
    "runs",
    "runs nosuch",
    "runs --json show last",
    "runs --runs file",
    "runs --runs none",
    "runs --runs empty",
    "runs show",
    "runs show nosuch",
    "runs show beta",
    "runs show last --runs none",
    "runs show 260101 --runs empty",
    "runs export nosuch",
    "runs export alpha --out file/a.json",
    "resume",
    "resume nosuch",
    "resume beta",
    "runs --runs noise",
    "runs show noise --runs noise",
    "runs show last --runs noise",
    *(f"runs export {name} --runs damaged-{name}" for name in DAMAGES),
    "runs show last --runs damaged-format",
    "runs --runs damaged-table",
    "runs show last --runs wrong",
    "runs show last --runs doubts",
    "resume alpha",
    "resume last --runs changed",
    "resume last --runs changed --max-qpu-seconds nan",
    "resume last --runs changed --max-qpu-seconds 0",
    "resume last --runs changed --max-qpu-seconds 1e7",
    "resume last --runs changed --max-wait-seconds 0",
    "resume last --runs changed --max-qpu-seconds 20",
    Command("resume last --runs changed --max-qpu-seconds 20", "declined", SOMEBODY, "n\n"),
    Command("resume last --runs changed", "held", setting("qcompile.live.home.FileLock", Busy)),
    "resume last --runs locked",
    "resume last --runs another",
    Command("resume last --runs strangers", "on another machine", elsewhere),
    Command("resume last --runs strangers --yes", "on another machine", elsewhere),
    "resume last --runs nowhere",
    "resume last --runs going",
)
