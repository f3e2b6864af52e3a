"""The jobs, circuits and executions of a run, from the ledger of the service."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from live_runs import Runs
from standin import StandIn

from qcompile.execution import OfflineExecutor, PrimitiveExecutor
from qcompile.passes import compile
from qcompile.policy import load_policy

Make = Callable[..., PrimitiveExecutor]


@pytest.mark.parametrize(("backend", "circuits"), [("fake_toronto", 1), ("fake_lima", 5)])
def test_a_step_of_lunarlander(
    executor_on: Make, service: StandIn, backend: str, circuits: int
) -> None:
    """24 circuits on 27 qubits are one circuit; on 5 qubits they are ceil(24 / 5)."""
    policy, executor = load_policy("lunarlander"), executor_on(backend)
    assert len(policy.program) == 24
    executable = compile(policy.trained_program, executor.device, 2, policy.importance)
    executor.run(executable, policy.encode(np.zeros((1, 8))), np.zeros(0), 100)
    [job] = service.ledger().jobs
    assert (job.circuits, job.shots, job.executions) == (circuits, 100, circuits * 100)


@pytest.mark.parametrize(("episodes", "circuits"), [(28, 1), (30, 2)])
def test_episodes_side_by_side_share_executions(runs: Runs, episodes: int, circuits: int) -> None:
    """Four circuits each: 28 episodes fit on the 114 good qubits of 127."""
    result = runs.run(backend="fake_sherbrooke", episodes=episodes, max_steps=2, shots=64).json()
    jobs = runs.service.ledger().jobs
    assert [(job.circuits, job.executions) for job in jobs] == [(circuits, 64 * circuits)] * 2
    assert result["copies"] == 28
    assert result["env_steps"] == 2 * episodes
    assert (result["jobs"], result["executions"]) == (2, 128 * circuits)


def test_copies_can_be_chosen(runs: Runs) -> None:
    runs.run("--copies", 4, backend="fake_sherbrooke", episodes=6, max_steps=1, shots=64)
    [job] = runs.service.ledger().jobs
    assert (job.circuits, job.executions) == (2, 128)  # six episodes, four by four


def test_the_living_share_one_job(runs: Runs) -> None:
    """Two episodes on five qubits: a circuit each; one of four circuits leaves a qubit free."""
    runs.run(episodes=2, max_steps=3)
    assert [job.circuits for job in runs.service.ledger().jobs] == [2, 2, 2]


def test_a_batch_above_the_limit_of_a_job_is_split(
    executor_on: Make, service: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a limit that a test can reach: five rows of 100 shots, two of them in a job."""
    monkeypatch.setattr("qcompile.execution.cost.MAX_EXECUTIONS_PER_JOB", 200)
    policy, executor = load_policy("cartpole"), executor_on("fake_lima")
    executable = compile(policy.trained_program, executor.device, 2, policy.importance)
    x = policy.encode(np.linspace(-1, 1, 20).reshape(5, 4))
    assert executor.run(executable, x, np.zeros(0), 100).shape == (5, 4)
    assert [job.circuits for job in service.ledger().jobs] == [2, 2, 1]


def test_a_split_batch_keeps_its_rows_and_columns(
    executor_on: Make, service: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two circuits in a job, of one round or of two: as many shots as tell them from each other."""
    monkeypatch.setattr("qcompile.execution.cost.MAX_EXECUTIONS_PER_JOB", 40_000)
    policy, executor = load_policy("lunarlander"), executor_on("fake_lima")
    executable = compile(policy.trained_program, executor.device, 2, policy.importance)
    x = policy.encode(np.linspace(-1, 1, 16).reshape(2, 8))
    shots = 20_000
    ones = executor.run(executable, x, np.zeros(0), shots)
    assert [job.circuits for job in service.ledger().jobs] == [2] * 5
    expected = OfflineExecutor(executor.device).expectation(executable, x, np.zeros(0))
    assert np.abs(1 - 2 * ones / shots - expected).max() < 6 / np.sqrt(shots)
    assert np.ptp(expected) > 0.5


@pytest.mark.parametrize("shots", [20, 24])
def test_a_split_row_is_an_execution_of_all_places(runs: Runs, shots: int) -> None:
    """Six places of cartpole's four circuits on the 25 good qubits of 27: 4 shots for 20 or 24.

    Two episodes of three steps, and a readout of 24 qubits in 2 + 2 * 5 patterns.
    """
    words = ("--split", "--calibration-shots", 100)
    settings = {"shots": shots, "mitigation": "readout"}
    result = runs.run(*words, backend="fake_toronto", **settings).json()
    jobs = runs.service.ledger().jobs
    assert [(job.shots, job.executions) for job in jobs] == [(100, 1200), *[(4, 8)] * 3]
    known = {"copies": 6, "split": True, "calibration_shots": 100, "jobs": 4, "executions": 1224}
    assert {name: result[name] for name in known} == known


def test_auto_is_settled_before_a_run_begins(runs: Runs) -> None:
    words = ("--split", "--calibration-shots", "auto")
    result = runs.run(*words, backend="fake_toronto", shots=20, mitigation="readout").json()
    calibration, *_ = runs.service.ledger().jobs
    assert (calibration.shots, calibration.executions) == (256, 12 * 256)
    assert result["calibration_shots"] == 256
    again = runs.call("resume", "last", "--json").json()
    assert again["episodes"] == result["episodes"]
