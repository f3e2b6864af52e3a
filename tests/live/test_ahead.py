"""Live runs that measure ahead: recorded before they are sent, killed and resumed, and replayed."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_runs import LIMIT_S, Runs, check_paid_once, killed, played
from standin import StandIn

from qcompile.deploy.deployment import Deployment
from qcompile.live.connection import Connection
from qcompile.live.perform import begin, complete
from qcompile.live.play import RunTask
from qcompile.live.records import Step
from qcompile.live.runs import find_journal
from qcompile.policy import load_policy
from qcompile.policy.files import policy_values

SETTINGS = {"speculate": 3, "shots": 8, "max_steps": 8}
"""Few shots, so that some predictions are wrong."""
WORDS = (
    *("run", "cartpole", "--backend", "fake_lima", "--live", "--yes", "--json"),
    *("--shots", "8", "--episodes", "2", "--max-steps", "8", "--mitigation", "none"),
    *("--speculate", "3", "--max-qpu-seconds", f"{LIMIT_S:g}"),
)


@pytest.fixture(scope="module")
def unkilled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """The result of the run when nothing goes wrong."""
    with pytest.MonkeyPatch.context() as patch, StandIn() as standin:
        for name, value in standin.environment().items():
            patch.setenv(name, value)
        patch.setenv("HOME", str(tmp_path_factory.mktemp("home")))
        task = RunTask.model_validate(
            {
                "backend": "fake_lima",
                "device": Connection("fake_lima").device(),
                "policy": policy_values(load_policy("cartpole")),
                "episodes": 2,
                "mitigation": "none",
                "copies": 1,
                **SETTINGS,
            }
        )
        yield played(complete(begin(tmp_path_factory.mktemp("runs"), task, LIMIT_S)))


def steps() -> list[Step]:
    with find_journal(Path("runs"), "last") as journal:
        return [*journal.steps]


def change(what: str, *values: object) -> None:
    """Change the journal of the only run, and replay it."""
    [path] = Path("runs").glob("*/journal.sqlite")
    with sqlite3.connect(path) as db:
        db.execute(what, values)
        db.execute("UPDATE run SET result = NULL")


def test_a_run_records_what_it_measures_and_plays_it_again(runs: Runs) -> None:
    first = runs.run(**SETTINGS).json()
    assert (first["speculate"], first["decisions"]) == (3, 16)
    assert first["jobs"] == len(runs.service.ledger().jobs) < 8
    recorded = steps()
    assert sum(len(step.observations) for step in recorded) == first["measured_rows"] > 16
    assert sum(len(step.rewards) for step in recorded if step.rewards is not None) == 16
    chains = recorded[0].chains
    assert chains is not None
    assert chains.episode.tolist() == [0, 1] * 3
    assert chains.decision.tolist() == [0, 0, 1, 1, 2, 2]
    change("UPDATE run SET result = NULL")
    again = runs.call("resume", "last", "--json")
    assert again.code == 0, again.err
    assert played(again.json()) == played(first)
    check_paid_once(runs.service, first["jobs"])


@pytest.mark.parametrize(
    ("request_", "times", "pause_s"),
    [("POST /jobs", 2, 0.05), ("GET /jobs/{id}/results", 2, 0.0)],
)
def test_a_killed_run_goes_on(
    runs: Runs, unkilled: dict[str, Any], request_: str, times: int, pause_s: float
) -> None:
    """Killed as soon as the service has seen this many of these requests."""
    runs.service.settings.run_seconds = 0.1
    killed(runs.service, WORDS, request_, times, pause_s)
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert played(found) == unkilled
    check_paid_once(runs.service, found["jobs"])
    assert len(runs.service.ledger().jobs) == found["jobs"]


def test_a_job_that_was_sent_is_the_same_whatever_is_predicted_later(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its rows are already recorded; a later version may predict differently."""
    real = time.sleep

    def interrupt(seconds: float) -> None:
        monkeypatch.setattr("qcompile.live.jobs.time.sleep", real)
        raise KeyboardInterrupt

    runs.service.settings.run_seconds = 2.0  # longer than a slow machine takes to the first look
    monkeypatch.setattr("qcompile.live.jobs.time.sleep", interrupt)
    answer = runs.run(**SETTINGS)
    runs.service.settings.run_seconds = 0.1
    assert answer.code == 1
    assert "Jobs done: 0, steps played: 0;" in answer.err
    [begun] = steps()
    assert begun.actions is None
    assert begun.chains is not None
    assert len(begun.observations) == 6
    monkeypatch.setattr("qcompile.deploy.depth.Depth.next", lambda self, load: 1)
    monkeypatch.setattr(Deployment, "predict", lambda self, seen, rows: np.zeros(len(seen), int))
    found = runs.until_finished(runs.call("resume", "last", "--json"))
    assert found["decisions"] == 16
    assert {len(step.observations) for step in steps()[1:]} == {1, 2}
    check_paid_once(runs.service, found["jobs"])


def array(values: Any) -> bytes:
    file = BytesIO()
    np.save(file, np.array(values))
    return file.getvalue()


@pytest.mark.parametrize(
    ("change_it", "words"),
    [
        (lambda rows: rows[:, :-1], "The rows of a step are damaged"),
        (lambda rows: rows[:2], "The rows of a step are damaged"),
        (
            lambda rows: np.add(rows, [[0], [1], [0], [0]]),
            "The rows of step 0 differ from the recorded ones",
        ),
        (lambda rows: np.add(rows, [[0], [0], [5], [0]]), "the actions of step 0 are not valid"),
        (lambda rows: np.add(rows, [[0], [0], [0], [5]]), "the actions of step 0 are not valid"),
        (lambda rows: rows * [[1], [1], [1], [0]], "differ from the recorded ones"),
    ],
)
def test_rows_that_do_not_fit_are_explained(runs: Runs, change_it: Any, words: str) -> None:
    runs.run(**SETTINGS)
    first = steps()[0]
    assert first.chains is not None
    assert first.actions is not None
    rows = np.stack([*first.chains.array, first.actions])
    change("UPDATE step SET actions = ? WHERE number = 0", array(change_it(rows)))
    answer = runs.call("resume", "last")
    assert answer.code == 1
    assert words in answer.err


def test_an_export_has_the_rows(runs: Runs) -> None:
    runs.run(**SETTINGS)
    exported = runs.call("runs", "export", "last").json()["steps"][0]
    assert exported["episode"] == [0, 1] * 3
    assert len(exported["predicted"]) == len(exported["actions"]) == 6
