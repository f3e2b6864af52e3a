"""The forecast of `plan` equals what the service's ledger shows afterwards."""

from __future__ import annotations

import shlex
from typing import Any

import pytest
from live_runs import Runs

from qcompile.planning import search

PAPER, PACKED = "as in the paper", "packed"
LOCKSTEP, TWIN = "packed, lockstep", "calibrate, play twin"


def planned(runs: Runs, *words: object) -> dict[str, Any]:
    answer = runs.call("plan", *words, "--json")
    assert answer.code == 0, answer.err
    return dict(answer.json())


@pytest.mark.parametrize(
    "settings",
    [
        {"backend": "fake_lima", "shots": 256, "mitigation": "none"},
        {"backend": "fake_lima", "shots": 100, "mitigation": "readout"},
        {"backend": "fake_toronto", "shots": 64, "mitigation": "response"},
    ],
    ids=["none", "readout", "response"],
)
def test_the_lockstep_is_what_a_live_run_sends(runs: Runs, settings: dict[str, Any]) -> None:
    """No episode ends before three steps: the forecast is exact, calibration included."""
    shared = ("cartpole", "--episodes", 3, "--max-steps", 3, "--live")
    words = [w for name, value in settings.items() for w in (f"--{name}", value)]
    plan = planned(runs, *shared, *words)
    assert not runs.service.ledger().jobs  # a plan spends nothing
    assert plan["env_steps"] == 9
    plain = ("--speculate", 1, "--calibration-shots", 8192, "--max-qpu-seconds", 600, "--yes")
    answer = runs.call("run", *shared, *words, *plain, "--json")
    assert answer.code == 0, answer.err
    jobs = runs.service.ledger().jobs
    [lockstep] = [way for way in plan["strategies"] if way["name"] == LOCKSTEP]
    assert lockstep["jobs"] == len(jobs)
    assert lockstep["executions"] == sum(job.executions for job in jobs)
    assert lockstep["qpu_seconds"] == pytest.approx(runs.service.ledger().charged_seconds)
    assert plan["copies"] == answer.json()["copies"]


def test_the_other_ways_by_hand(runs: Runs) -> None:
    """Four circuits, nine steps of 100 shots on 27 qubits; the twin of four qubits is one job."""
    words = ("cartpole", "--backend", "fake_toronto", "--episodes", 3, "--max-steps", 3)
    plan = planned(runs, *words, "--shots", 100, "--mitigation", "none", "--usd-per-second", 2)
    found = {way["name"]: way for way in plan["strategies"]}
    assert list(found) == [PAPER, PACKED, LOCKSTEP, TWIN]
    loads = {name: (way["jobs"], way["executions"]) for name, way in found.items()}
    assert loads == {
        PAPER: (36, 3600),
        PACKED: (9, 900),
        LOCKSTEP: (3, 300),
        TWIN: (1, 6 * 8192),
    }
    seconds = {PAPER: 73.26, PACKED: 18.315, LOCKSTEP: 6.105, TWIN: 19.2032}
    for name, expected in seconds.items():
        assert found[name]["qpu_seconds"] == pytest.approx(expected)
        assert found[name]["price_usd"] == pytest.approx(2 * expected)
        assert found[name]["share_of_free_plan"] == pytest.approx(expected / 600)


def test_readout_is_measured_for_all_but_the_papers_way(runs: Runs) -> None:
    """Four qubits are prepared in six patterns of 8192 shots, in a job of their own."""
    words = ("cartpole", "--backend", "fake_toronto", "--max-steps", 2, "--shots", 100)
    ways = [
        {way["name"]: way for way in planned(runs, *words, "--mitigation", kind)["strategies"]}
        for kind in ("none", "readout")
    ]
    more = {name: ways[1][name]["executions"] - ways[0][name]["executions"] for name in ways[0]}
    assert more == {PAPER: 0, PACKED: 6 * 8192, LOCKSTEP: 6 * 8192, TWIN: 0}


def test_split_rows_by_hand(runs: Runs) -> None:
    """Six places of four circuits on 25 good qubits: 9 rows of ceil(100 / 6) shots in 3 jobs.

    The calibration of 24 qubits takes 2 + 2 * 5 patterns. Without copies nothing is split.
    """
    words = ("cartpole", "--backend", "fake_toronto", "--episodes", 3, "--max-steps", 3)
    words += ("--shots", 100, "--split", "--calibration-shots", 200)
    plan = planned(runs, *words)
    found = {way["name"]: (way["jobs"], way["executions"]) for way in plan["strategies"]}
    assert plan["copies"] == 6
    assert found[LOCKSTEP] == (4, 9 * 17 + 12 * 200)
    assert found[PACKED] == (10, 9 * 100 + 6 * 200)


def test_the_command_of_a_live_plan_plays_on_the_machine(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command works as typed, within the planned seconds."""
    monkeypatch.setattr(search, "_LEAST", 4)
    monkeypatch.setattr(search, "_MOST", 4)
    words = ("cartpole_1q", "--backend", "fake_lima", "--episodes", 2, "--shots", 64)
    found = planned(runs, *words, "--copies", 1, "--max-steps", 3, "--within", 60.5, "--live")
    command = found["recommended"]["command"]
    assert command.endswith(" --live --max-qpu-seconds 60.5")
    assert not runs.service.ledger().jobs
    answer = runs.call(*shlex.split(command)[1:], "--yes", "--json")
    assert answer.code == 0, answer.err
    told = answer.json()
    assert told["kind"] == "hardware"
    assert told["qpu_seconds"] == runs.service.ledger().charged_seconds
    assert told["max_qpu_seconds"] == 60.5
