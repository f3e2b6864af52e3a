"""What live runs with circuits of several qubits cost, calibrate and refuse, by the ledger."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from live_ledger import charged_s, jobs_of, settled_wrong, told_wrong
from live_runs import LIMIT_S, Runs, check_paid_once
from wide_policies import PAIR, policy

import qcompile
from qcompile.planning import search
from qcompile.policy import save_policy

LOCKSTEP = "packed, lockstep"
LIVE = ("--live", "--yes", "--json", "--max-qpu-seconds", f"{LIMIT_S:g}")


@pytest.fixture(autouse=True)
def _policy_file(empty_folder: Path) -> None:
    save_policy(policy(), "ring.json")


def told(runs: Runs, *words: object) -> dict[str, Any]:
    answer = runs.call(*words, *LIVE)
    assert answer.code == 0, answer.err
    found = dict(answer.json())
    charged = charged_s(jobs_of(runs.service, found["run"]))
    assert not told_wrong(found, charged, LIMIT_S)
    assert not settled_wrong(found, charged)
    return found


@pytest.mark.parametrize(
    "settings",
    [
        ("--backend", "fake_lima", "--mitigation", "none"),
        ("--backend", "fake_lima", "--mitigation", "readout"),
        ("--backend", "fake_toronto", "--mitigation", "readout"),
        ("--backend", "fake_toronto", "--mitigation", "readout", "--split"),
        ("--backend", "fake_toronto", "--mitigation", "none", "--copies", "2"),
    ],
)
def test_the_plan_is_what_the_ledger_says(runs: Runs, settings: tuple[str, ...]) -> None:
    """Executions are shots x rounds x rows; copies share them, and each costs its calibration."""
    shared = ("ring.json", "--episodes", 3, "--max-steps", 3, "--shots", 100, *settings)
    shared = (*shared, "--calibration-shots", 200)
    planned = runs.call("plan", *shared, "--live", "--json")
    assert planned.code == 0, planned.err
    assert not runs.service.ledger().jobs  # a plan spends nothing
    found = told(runs, "run", *shared, "--speculate", 1)
    jobs = runs.service.ledger().jobs
    [lockstep] = [way for way in planned.json()["strategies"] if way["name"] == LOCKSTEP]
    assert {way["name"] for way in planned.json()["strategies"]} == {
        *("as in the paper", "packed", LOCKSTEP)
    }
    assert (lockstep["jobs"], lockstep["executions"]) == (
        len(jobs),
        sum(job.executions for job in jobs),
    )
    assert lockstep["qpu_seconds"] == pytest.approx(found["qpu_seconds"])
    assert planned.json()["copies"] == found["copies"]
    check_paid_once(runs.service, len(jobs))


def test_copies_share_executions(runs: Runs) -> None:
    """Of three copies that fit, each plays an episode: one circuit a job. Alone there are three."""
    words = ("run", "ring.json", "--backend", "fake_toronto", "--episodes", 3, "--shots", 64)
    words = (*words, "--max-steps", 2, "--mitigation", "none", "--speculate", 1)
    assert told(runs, *words)["copies"] == 3
    assert [job.circuits for job in runs.service.ledger().jobs] == [1, 1]


def test_the_qubits_of_a_policy_are_calibrated_and_used(runs: Runs) -> None:
    """Its readout alone, by default; the run then pays for no other calibration."""
    words = ("calibrate", "--backend", "fake_lima", "--policy", "ring.json", "--shots", 500)
    told(runs, *words, "--out", "made.json")
    made = json.loads(Path("made.json").read_text())
    executable = qcompile.compile(policy().trained_program, qcompile.load_device("fake_lima"))
    assert made["qubits"] == sorted(executable.bit_qubits.tolist())
    assert made["response"] is None
    check = runs.call("calibrate", "--backend", "fake_lima", "--check", "made.json", *LIVE)
    assert check.code == 0, check.err
    assert check.json()["check"]["drifted"] == []
    before = len(runs.service.ledger().jobs)
    words = ("run", "ring.json", "--backend", "fake_lima", "--shots", 64, "--max-steps", 2)
    found = told(runs, *words, "--calibration", "made.json", "--speculate", 1, "--episodes", 2)
    assert found["mitigation"] == "readout"
    assert len(runs.service.ledger().jobs) == before + 2


def test_a_calibration_has_as_many_shots_as_the_run_needs(runs: Runs) -> None:
    """By default: six patterns of four qubits at 256 shots for rows of 64, not at 8192."""
    words = ("run", "ring.json", "--backend", "fake_lima", "--shots", 64, "--max-steps", 2)
    assert told(runs, *words, "--episodes", 2)["calibration_shots"] == 256
    calibration, *_ = runs.service.ledger().jobs
    assert (calibration.shots, calibration.executions) == (256, 6 * 256)


def test_curves_of_single_qubits_are_refused_before_anything_is_paid(runs: Runs) -> None:
    run = ("run", "ring.json", "--backend", "fake_lima", "--shots", 64, *LIVE)
    curves = ("calibrate", "--backend", "fake_lima", "--seed", 0, "--out", "twin.json")
    assert runs.call(*curves).code == 0
    refused = {
        (*run, "--mitigation", "response"): "Response mitigation needs circuits of one qubit",
        (*run, "--predistort"): "Predistortion needs circuits of one qubit",
        ("validate", "twin.json", "--policy", "ring.json", *LIVE): (
            "validate needs circuits of one qubit: circuit 0 has 3.\n"
            "  A twin has the curves of single qubits; name another --policy.\n"
        ),
        ("validate", "twin.json", "--policy", "ring.json"): "validate needs circuits of one qubit",
        ("run", "ring.json", "--backend", "twin.json"): "A twin needs circuits of one qubit",
    }
    for words, message in refused.items():
        answer = runs.call(*words)
        assert answer.code == 1
        assert f"Error: {message}" in answer.err
    assert not runs.service.ledger().jobs


def test_the_command_of_a_live_plan_works_as_typed(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the copies that fit, as many share an execution as there are episodes."""
    monkeypatch.setattr(search, "_LEAST", 3)
    monkeypatch.setattr(search, "_MOST", 3)
    monkeypatch.setattr(search, "LADDER", (16,))
    Path("pair.json").write_text(json.dumps(PAIR))
    words = ("plan", "pair.json", "--backend", "fake_toronto", "--episodes", 2, "--live")
    answer = runs.call(*words, "--within", 500, "--keep", 0.1, "--max-steps", 10, "--json")
    assert answer.code == 0, answer.err
    chosen = answer.json()["recommended"]
    assert chosen["copies"] >= 2
    assert not runs.service.ledger().jobs
    runs.service.settings.usage_limit_seconds = 1e9
    played = runs.call(*shlex.split(chosen["command"])[1:], "--yes", "--json")
    assert played.code == 0, played.err
    assert played.json()["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
    assert played.json()["qpu_seconds"] < 500
