"""A twin against its machine: a true one passes as often as stated, a changed one is named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from live_runs import Runs
from scipy.stats import binom, kstest

from qcompile.deploy.twin_check import check_twin
from qcompile.device import load_device
from qcompile.errors import CalibrationError
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate
from qcompile.mitigation.measure import LIVE_ANGLES_RAD
from qcompile.policy import load_policy

LIVE = ("--live", "--max-qpu-seconds", 60, "--yes")


@pytest.fixture
def machine(runs: Runs) -> str:
    """The file of a calibration of the live fake_lima; the machine's shots are new since."""
    words = ("--backend", "fake_lima", "--shots", 8192, "--out", "lima.json", "--json")
    answer = runs.call("calibrate", *words, *LIVE)
    assert answer.code == 0, answer.err
    runs.service.settings.seed = 1
    return "lima.json"


def tamper(file: str, qubit: int, by: float) -> None:
    """Move the offset of a qubit's curve."""
    values = json.loads(Path(file).read_text())
    values["response"]["curves"][values["qubits"].index(qubit)][0] += by
    Path(file).write_text(json.dumps(values))


def test_a_true_twin_passes_live(runs: Runs, machine: str) -> None:
    words = ("validate", machine, "--policy", "cartpole", "--observations", 8)
    answer = runs.call(*words, *LIVE, "--json")
    assert answer.code == 0, answer.err
    found = answer.json()
    assert found["passed"] is True
    assert found["failed"] == []
    assert found["degrees"] == [8] * 4
    assert min(found["p_value"]) > 1e-4
    job = runs.service.ledger().jobs[-1]
    assert (job.circuits, job.shots) == (8, found["shots"])
    assert found["qpu_seconds"] == pytest.approx(2 + 0.00035 * 8 * found["shots"])
    assert found["least_power"] >= 0.9
    assert f"1 job, {8 * found['shots']:,} executions, about" in answer.err
    text = runs.call("runs", "show", "last")
    assert text.code == 0
    assert "pass; the largest difference in <Z> is" in text.out


def test_a_moved_qubit_is_named_live_and_offline(runs: Runs, machine: str) -> None:
    """By 0.05, some five standard errors of each <Z>; the policy is placed on four of five."""
    placed = runs.call("validate", machine, "--policy", "cartpole", "--json").json()["qubits"]
    tamper(machine, placed[1], -0.05)
    for live in (LIVE, ()):
        words = ("--policy", "cartpole", "--shots", 8192)
        answer = runs.call("validate", machine, *words, *live)
        assert answer.code == 1
        assert (
            f"Error: The twin of {machine} is not its machine any more: qubit {placed[1]}.\n"
            "  Calibrate anew: `qcompile calibrate`. If a new one fails too, "
        ) in answer.err
        assert answer.out.count("fails") == 1


def test_another_device_is_refused(runs: Runs, machine: str) -> None:
    before = len(runs.service.ledger().jobs)
    answer = runs.call("validate", machine, "--policy", "cartpole", "--backend", "fake_belem")
    assert answer.code == 1
    assert "The calibration belongs to fake_lima; the backend is fake_belem." in answer.err
    assert len(runs.service.ledger().jobs) == before


def test_false_alarms_are_as_rare_as_stated() -> None:
    """Fresh calibrations and fresh counts of one machine: p-values are uniform."""
    device, policy = load_device("fake_lima"), load_policy("cartpole")
    observations = np.random.default_rng(5).uniform(-1, 1, (4, 4))
    p_values, failed, times = [], 0, 300
    for seed in range(times):
        calibration = calibrate(
            OfflineExecutor(device, seed),
            np.arange(5),
            2048,
            parts=["response"],
            angles_rad=LIVE_ANGLES_RAD,
        )
        executor = OfflineExecutor(device, 10_000 + seed)
        found = check_twin(calibration, policy, observations, executor, 2048)
        p_values += found.p_value.tolist()
        failed += bool(found.failed)
    assert len(p_values) == 4 * times
    assert kstest(p_values, "uniform").pvalue > 1e-3
    assert failed <= binom.isf(1e-6, times, 0.001)


def test_a_twin_without_curves_has_nothing_to_compare() -> None:
    device = load_device("fake_lima")
    calibration = calibrate(OfflineExecutor(device, 0), np.arange(5), 100, parts=["readout"])
    with pytest.raises(CalibrationError, match="has no response curves"):
        check_twin(
            calibration, load_policy("cartpole"), np.zeros((1, 4)), OfflineExecutor(device), 9
        )
