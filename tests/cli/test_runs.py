"""`qcompile runs` and `resume` on journals written by hand: no service, no account."""

from __future__ import annotations

import json
import sqlite3
from base64 import b64decode
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_runs import measured_ones

from qcompile.live.journal import Journal
from qcompile.live.records import Submission

Call = Callable[..., Any]
RESULT = {"passed": True, "failed": [], "qubits": [3], "chi_square": [4.0], "degrees": [5],
          "p_value": [0.5], "largest_difference": 0.02, "file": "lima.json",
          "shots": 100}  # fmt: skip
VERSIONS = {"numpy": "2.0.1"}


def settle(made: Journal, job_id: str, charged_s: float) -> None:
    charge = made.charges.of_job(job_id)
    assert charge is not None
    made.charges.settle(charge, charged_s)


def journal(kind: Any = "run", runs: str = "runs") -> Journal:
    """A run with a job done, one that failed and one under way, and a step and a half.

    What the one that failed was charged is not known, nor is the second job of the first.
    """
    made = Journal.create(Path(runs), kind, "cart", {"backend": "somewhere"}, VERSIONS, 9.0)

    def sent(number: int, job_id: str) -> Submission:
        submission = made.note_sending(made.intend(number, "d", 100), 3)
        made.note_sent(submission, job_id)
        return submission

    done = sent(0, "job-a")
    made.charges.note_unexpected(0, 100, 3, datetime.now(UTC), "job-x")
    made.note_done(done, [measured_ones([[3, 97]], 100)])
    settle(made, "job-a", 2.25)
    made.note_failed(sent(1, "job-b"), "it rained")
    sent(1, "job-c")
    made.steps.note_actions(0, np.array([[0.5, -1.0]]), np.array([1]))
    made.steps.note_rewards(0, [1.0])
    made.steps.note_actions(1, np.array([[0.25, 2.0]]), np.array([0]))
    return made


def test_an_empty_folder(qcompile: Call) -> None:
    answer = qcompile("runs")
    assert (answer.code, answer.out, answer.err) == (0, "There is no live run in runs.\n", "")
    assert qcompile("runs", "--json").json() == []


def test_the_list(qcompile: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    first = journal()
    first.finish(RESULT)
    second = journal("validate")
    rows = qcompile("runs", "--json").json()
    assert {row["run"] for row in rows} == {first.id, second.id}
    row = next(row for row in rows if row["run"] == first.id)
    assert row == {
        "run": first.id,
        "kind": "run",
        "backend": "somewhere",
        "created": first.created.isoformat(),
        "state": "finished",
        "jobs_done": 1,
        "jobs_open": 1,
        "steps": 2,
        "qpu_seconds": 2.25 + 3 * 3,
        "qpu_seconds_settled": 2.25,
        "jobs_uncharged": 2,
        "jobs_in_doubt": 0,
        "max_qpu_seconds": 9.0,
    }
    answer = qcompile("runs")
    assert answer.code == 0
    assert first.id in answer.out
    assert second.id in answer.out
    assert "unfinished" in answer.out


def test_jobs_in_doubt_are_told_with_when_they_can_be_settled(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two submissions without an answer, of 3 s each, beside 2.25 s charged and 9 s not yet."""
    monkeypatch.setenv("COLUMNS", "140")
    made = journal()
    for number in (2, 3):
        last = made.note_sending(made.intend(number, "d", 100), 3)
    [row] = qcompile("runs", "--json").json()
    assert (row["qpu_seconds"], row["qpu_seconds_settled"]) == (2.25 + 9 + 6, 2.25)
    assert (row["jobs_uncharged"], row["jobs_in_doubt"]) == (2, 2)
    assert last.sent_at is not None
    due = last.sent_at + timedelta(hours=1)
    assert (
        "2.2 QPU seconds charged, 17.2 at most (2 jobs not charged yet, 2 jobs in doubt); the "
        "limit is 9\n"
        "IBM may have accepted 2 more jobs, at most 6 s; "
        f"`qcompile resume {made.id}` after {due:%H:%M} UTC finds out.\n"
    ) in qcompile("runs", "show", "last").out
    table = qcompile("runs").out
    assert "17.2 of 9" in table
    assert "2 jobs" in table


def test_another_folder_by_option_and_by_environment(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = journal(runs="elsewhere")
    assert [row["run"] for row in qcompile("runs", "--runs", "elsewhere", "--json").json()] == [
        made.id
    ]
    assert qcompile("runs", "--json").json() == []
    monkeypatch.setenv("QCOMPILE_RUNS", "elsewhere")
    assert len(qcompile("runs", "--json").json()) == 1


def test_where_an_unfinished_run_stands(qcompile: Call) -> None:
    made = journal()
    answer = qcompile("runs", "show", "last")
    assert answer.code == 0
    assert answer.out == (
        f"{made.id}, run on somewhere: unfinished\n"
        "Jobs done: 1, steps played: 2; everything is kept.\n"
        "2.2 QPU seconds charged, 11.2 at most (2 jobs not charged yet); the limit is 9\n"
        f"`qcompile resume {made.id}` resumes it.\n"
    )
    values = qcompile("runs", "show", made.id, "--json").json()
    assert (values["state"], values["result"]) == ("unfinished", None)


def test_a_finished_run_is_shown_again_without_asking_anybody(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("QISKIT_IBM_URL", "http://127.0.0.1:9/experimental")
    made = Journal.create(Path("runs"), "validate", "cart", settings(), VERSIONS, 9.0)
    paid = made.note_sending(made.intend(0, "d", 100), 3)
    made.note_sent(paid, "job-a")
    made.note_done(paid, [])
    settle(made, "job-a", 2.25)
    made.charges.note_reconciled()
    made.finish(RESULT)
    for words in (("runs", "show"), ("resume",)):
        answer = qcompile(*words, "last")
        assert answer.code == 0, answer.err
        assert "pass; the largest difference in <Z> is 0.020" in answer.out
        assert answer.out.endswith(f"run {made.id}: 2.2 QPU seconds charged\n")
    found = qcompile("resume", "last", "--json").json()
    assert found == {
        **RESULT,
        "run": made.id,
        "qpu_seconds": 2.25,
        "qpu_seconds_settled": 2.25,
        "jobs_uncharged": 0,
        "jobs_in_doubt": 0,
        "max_qpu_seconds": 9.0,
    }
    assert qcompile("runs", "show", "last", "--json").json()["result"] == found


def test_a_finished_run_says_of_how_many_jobs_the_charge_is_not_known(qcompile: Call) -> None:
    made = journal("validate")
    made.finish(RESULT)
    answer = qcompile("runs", "show", "last")
    assert answer.out.endswith(
        f"run {made.id}: 2.2 QPU seconds charged, 11.2 at most (2 jobs not charged yet)\n"
    )
    made.note_failed(made.attempts(1)[-1], "it rained as well")
    for job_id, charged_s in (("job-b", 1.0), ("job-x", 0.5), ("job-c", 0.0)):
        settle(made, job_id, charged_s)
    assert qcompile("runs", "show", "last").out.endswith(": 3.8 QPU seconds charged\n")


def overwrite(folder: Path) -> None:
    """It cannot be opened."""
    (folder / "journal.sqlite").write_bytes(b"nothing of a database " * 300)


def lose_a_part(folder: Path) -> None:
    """It is opened, and breaks off where it is read."""
    with sqlite3.connect(folder / "journal.sqlite") as db:
        db.execute("DROP TABLE submission")


@pytest.mark.parametrize("damage", [overwrite, lose_a_part])
def test_a_damaged_run_hides_no_other(qcompile: Call, damage: Callable[[Path], None]) -> None:
    broken, kept = journal(), journal()
    damage(broken.folder)
    answer = qcompile("runs", "--json")
    assert answer.code == 1
    assert [row["run"] for row in answer.json()] == [kept.id]
    assert f"Error: runs/{broken.id}/journal.sqlite cannot be read: " in answer.err
    assert "cannot be read" in answer.err
    assert kept.id in qcompile("runs").out
    assert qcompile("runs", "show", kept.id, "--json").json()["run"] == kept.id
    answer = qcompile("runs", "show", broken.id)
    assert (answer.code, answer.out) == (1, "")
    assert "cannot be read" in answer.err


def settings() -> dict[str, Any]:
    """What a task of a validation needs."""
    from qcompile.device import load_device
    from qcompile.execution import OfflineExecutor
    from qcompile.live.validate import ValidateTask
    from qcompile.mitigation import calibrate
    from qcompile.policy import load_policy
    from qcompile.policy.files import policy_values

    device = load_device("fake_lima")
    task = ValidateTask.model_validate(
        {
            "backend": "fake_lima",
            "device": device,
            "calibration": calibrate(OfflineExecutor(device), np.arange(5), None),
            "calibration_file": "lima.json",
            "policy": policy_values(load_policy("cartpole")),
            "observations": [[0.0] * 4],
            "shots": 100,
        }
    )
    return task.model_dump(mode="json")


def test_all_that_a_run_holds(qcompile: Call) -> None:
    made = journal()
    values = qcompile("runs", "export", "last").json()
    assert values["settings"] == {"backend": "somewhere"}
    assert values["versions"] == VERSIONS
    assert [(job["number"], job["attempt"], job["state"]) for job in values["jobs"]] == [
        (0, 0, "done"),
        (1, 0, "failed"),
        (1, 1, "sent"),
    ]
    [bits] = values["jobs"][0]["measured"]
    packed = b64decode(bits["packed"])
    assert [packed.count(byte) for byte in (0b00, 0b01, 0b10, 0b11)] == [3, 0, 94, 3]
    own = {"pub": 0, "register": "c", "shape": [1, 100], "bits": 2, "ones": [[3, 97]]}
    assert bits == own | {"packed": bits["packed"]}
    assert values["jobs"][0]["ones"] is None
    assert values["jobs"][2]["measured"] is None
    assert values["jobs"][1]["words"] == "it rained"
    assert [job["job_id"] for job in values["jobs"]] == ["job-a", "job-b", "job-c"]
    assert [job["qpu_seconds"] for job in values["jobs"]] == [2.25, None, None]
    first = made.latest(0)
    assert first is not None
    assert first.sent_at is not None
    assert values["jobs"][0]["sent_at"] == first.sent_at.isoformat()
    assert values["steps"] == [
        {"observations": [[0.5, -1.0]], "actions": [1], "rewards": [1.0]},
        {"observations": [[0.25, 2.0]], "actions": [0], "rewards": None},
    ]
    answer = qcompile("runs", "export", made.id, "--out", "all.json")
    assert answer.out == "3 jobs and 2 steps in all.json\n"
    assert json.loads(Path("all.json").read_text()) == values


def test_a_run_that_goes_on_elsewhere_is_left_alone(qcompile: Call) -> None:
    made = Journal.create(Path("runs"), "validate", "cart", settings(), VERSIONS, 9.0)
    with made.locked():
        for more in ((), ("--max-qpu-seconds", 20, "--yes")):
            answer = qcompile("resume", "last", *more)
            assert answer.code == 1
            assert f"Error: Run {made.id} is running in another process.\n" in answer.err
    assert made.max_qpu_seconds == 9.0


def test_a_run_of_a_newer_version_is_explained(qcompile: Call) -> None:
    made = journal()
    answer = qcompile("resume", "last")
    assert answer.code == 1
    assert (
        f"Error: This version of qcompile cannot read runs/{made.id}/journal.sqlite.\n"
        in answer.err
    )
    assert "Traceback" not in answer.err


def test_a_limit_of_nan_is_none(qcompile: Call) -> None:
    made = journal()
    assert qcompile("resume", "last", "--max-qpu-seconds", "nan", "--yes").code == 2
    assert made.max_qpu_seconds == 9.0
