"""A calibration of a machine: one job, curves that match the noise, usable as twin and file."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from live_runs import Runs
from scipy.stats import norm

from qcompile.calibration import Calibration, load_calibration
from qcompile.device import Device, load_device
from qcompile.errors import CalibrationError
from qcompile.execution import OfflineExecutor
from qcompile.ir import Circuit, Program
from qcompile.live.connection import Connection
from qcompile.live.measure import CalibrateTask
from qcompile.mitigation.measure import LIVE_ANGLES_RAD
from qcompile.noise import usable
from qcompile.passes import compile

SHOTS = 2000


def true_curves(device: Device, qubits: tuple[int, ...]) -> np.ndarray:
    """b, c, s of sx rz(a) sx, of its exact <Z> at a = pi, 3 pi / 2 and 2 pi.

    They are native angles of ry(0), ry(pi / 2) and ry(pi).
    """
    program = Program.of([Circuit.parse("ry(x0)")] * len(qubits), inputs=1)
    made = compile(program, device)
    placed = replace(made, qubits=np.array(qubits), rounds=np.zeros(len(qubits), dtype=int))
    x = np.array([[0.0], [np.pi / 2], [np.pi]])
    np.testing.assert_allclose(made.bind(x, np.zeros(0))[:, 0], [np.pi, 1.5 * np.pi, 2 * np.pi])
    below, side, above = OfflineExecutor(device).expectation(placed, x, np.zeros(0))
    offset = (below + above) / 2
    return np.stack([offset, (above - below) / 2, offset - side], axis=1)


def calibrated(runs: Runs, *words: object, backend: str = "fake_lima", shots: int = SHOTS) -> Any:
    return runs.call(
        *("calibrate", "--backend", backend, "--shots", shots, "--out", "machine.json", "--json"),
        *("--live", "--max-qpu-seconds", 100, "--yes", *words),
    )


def test_one_job_whose_curves_are_those_of_the_noise(runs: Runs) -> None:
    """Six angles; every number of every curve within six of its own standard errors."""
    answer = calibrated(runs, backend="fake_toronto")
    assert answer.code == 0, answer.err
    [job] = runs.service.ledger().jobs
    assert (job.circuits, job.shots) == (6, SHOTS)
    found = load_calibration(Path("machine.json"))
    assert found.kind == "hardware"
    assert found.backend == "fake_toronto"
    assert found.readout is None
    device = Connection("fake_toronto").device()
    assert list(found.qubits) == sorted(usable(device))
    assert found.response is not None
    truth = true_curves(device, found.qubits)
    errors = np.sqrt(np.diagonal(np.array(found.response.covariance), axis1=1, axis2=2))
    off = (np.array(found.response.curves) - truth) / errors
    assert np.abs(off).max() < norm.isf(1e-7 / off.size)
    assert 0.5 < np.sqrt(np.mean(off**2)) < 1.3  # the errors are neither too small nor too large


def test_the_file_plays_as_twin_and_mitigates(runs: Runs) -> None:
    assert calibrated(runs).code == 0
    short = ("--episodes", 1, "--max-steps", 2, "--shots", 64, "--json")
    twin = runs.call("run", "cartpole", "--backend", "machine.json", *short)
    assert twin.code == 0, twin.err
    assert twin.json()["kind"] == "measured-response"
    live = ("--live", "--max-qpu-seconds", 20, "--yes", "--speculate", 1)
    file = ("--backend", "fake_lima", "--calibration", "machine.json")
    mitigated = runs.call("run", "cartpole", *file, *short, *live)
    assert mitigated.code == 0, mitigated.err
    assert mitigated.json()["mitigation"] == "response"
    assert mitigated.json()["kind"] == "hardware"
    assert mitigated.json()["calibration"] == "machine.json"
    assert len(runs.service.ledger().jobs) == 1 + 2  # nothing is calibrated twice


def test_both_parts_are_a_job_each(runs: Runs) -> None:
    assert calibrated(runs, "--parts", "readout,response", shots=100).code == 0
    assert [job.circuits for job in runs.service.ledger().jobs] == [8, 6]
    assert load_calibration(Path("machine.json")).readout is not None


def test_chosen_qubits(runs: Runs) -> None:
    assert calibrated(runs, "--qubits", "0,3", backend="fake_toronto", shots=100).code == 0
    assert load_calibration(Path("machine.json")).qubits == (0, 3)


def test_counts_that_cannot_be_fitted_are_kept(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine whose bits are all 0, whatever the angle: it is paid for all the same."""
    monkeypatch.setattr("standin.service.draw", silent)
    answer = calibrated(runs, shots=100)
    assert answer.code == 1
    assert "Error: Some fits failed. The counts are in machine.json." in answer.err
    assert len(runs.service.ledger().jobs) == 1
    kept = Calibration.model_validate(json.loads(Path("machine.json").read_text()))
    assert kept.response is None
    assert kept.response_counts is not None
    assert np.array(kept.response_counts.ones).tolist() == [[0.0] * 5] * 6
    assert runs.call("runs", "show", "last").code == 0


def silent(items: Any, device: Any, seed: int) -> Any:
    return [
        {
            name: np.zeros((*item.shape, item.shots, len(qubits)), dtype=bool)
            for name, qubits in item.plan.registers.items()
        }
        for item in items
    ]


def test_a_file_that_is_there_is_refused_before_anything_is_sent(runs: Runs) -> None:
    Path("machine.json").write_text("paid for")
    answer = calibrated(runs)
    assert answer.code == 1
    assert "machine.json already exists." in answer.err
    assert not runs.service.ledger().jobs


def test_force_overwrites_the_file_itself(runs: Runs) -> None:
    """No second file is written, not even after another calibration."""
    Path("machine.json").write_text("old")
    answer = calibrated(runs, "--force", shots=100)
    assert answer.code == 0, answer.err
    assert answer.json()["file"].endswith("/machine.json")
    first = load_calibration(Path("machine.json"))
    runs.service.settings.queue_seconds = 0.3
    runs.service.settings.seed = 5
    assert calibrated(runs, "--force", "--max-wait-seconds", 0.05, shots=100).code == 1
    assert load_calibration(Path("machine.json")) == first
    assert runs.call("resume", "last", "--json").code == 0
    assert load_calibration(Path("machine.json")).response_counts != first.response_counts
    assert [path.name for path in Path().glob("*.json")] == ["machine.json"]


def test_without_force_a_file_that_came_in_between_is_kept(runs: Runs) -> None:
    runs.service.settings.queue_seconds = 0.3
    assert calibrated(runs, "--max-wait-seconds", 0.05, shots=100).code == 1
    Path("machine.json").write_text("mine")
    answer = runs.call("resume", "last", "--json")
    assert answer.code == 0, answer.err
    assert Path("machine.json").read_text() == "mine"
    other = Path(answer.json()["file"])
    assert other.name == f"machine-{answer.json()['run']}.json"
    assert load_calibration(other).kind == "hardware"


def test_misfits_are_told_before_anything_is_spent(runs: Runs) -> None:
    assert calibrated(runs).code == 0
    values = json.loads(Path("machine.json").read_text())
    values["response"]["chi_square"] = [500.0] * 5
    Path("machine.json").write_text(json.dumps(values))
    words = ("--backend", "fake_lima", "--calibration", "machine.json", "--max-steps", 2)
    answer = runs.call(
        *("run", "cartpole", *words, "--episodes", 1, "--shots", 64, "--json"),
        *("--live", "--max-qpu-seconds", 20, "--yes"),
    )
    assert answer.code == 0, answer.err
    told, spent = answer.err.split("fake_lima: ", 1)
    assert "machine.json: The response of qubit 0, " in told
    assert "QPU seconds" in spent
    assert len(answer.json()["calibration_misfits"]) == 4


class Counted:
    """A run whose executor is the noise model; `asked` records its requests."""

    jobs = SimpleNamespace(journal=SimpleNamespace(latest=lambda number: None))

    def __init__(self) -> None:
        self.asked: list[Any] = []

    def say(self, words: str) -> None:
        pass

    def executor(self, device: Device) -> OfflineExecutor:
        asked = self.asked

        class Noted(OfflineExecutor):
            def run(self, executable: Any, x: Any, theta: Any, shots: int) -> Any:
                asked.append((executable.native.inputs, x))
                return super().run(executable, x, theta, shots)

        return Noted(device, 0)


def test_a_journal_of_version_0_1_goes_on_with_its_own_circuits() -> None:
    """One angle for each circuit, the same on all qubits."""
    device, context = load_device("fake_lima"), Counted()
    task = CalibrateTask.model_validate(
        {
            "backend": "fake_lima",
            "device": device,
            "qubits": (0, 3),
            "shots": 500,
            "parts": ("response",),
            "angles_rad": LIVE_ANGLES_RAD.tolist(),
            "out": None,
        }
    )
    found = task.perform(context)["calibration"]  # type: ignore[arg-type]
    ((inputs, x),) = context.asked
    assert inputs == ("x0",)
    np.testing.assert_array_equal(x, LIVE_ANGLES_RAD[:, None])
    assert found["unfitted"] == []


def test_counts_that_a_run_kept_are_fitted_anew(
    runs: Runs, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as failing:
        failing.setattr("qcompile.mitigation.measure.fit_response", unfit)
        assert calibrated(runs).code == 1
    answer = runs.call("calibrate", "--from", "machine.json", "--out", "new.json", "--json")
    assert answer.code == 0, answer.err
    kept, found = (load_calibration(Path(name)) for name in ("machine.json", "new.json"))
    assert kept.response is None
    assert (found.kind, found.created) == ("hardware", kept.created)
    assert found.response is not None
    assert len(runs.service.ledger().jobs) == 1


def unfit(*_: Any) -> None:
    raise CalibrationError("No fit.")


def test_a_calibration_goes_on_where_it_stopped(runs: Runs) -> None:
    """With the same counts as an uninterrupted one, in the same file."""
    assert calibrated(runs).code == 0
    whole = load_calibration(Path("machine.json"))
    Path("machine.json").unlink()
    runs.service.settings.queue_seconds = 0.3
    assert calibrated(runs, "--max-wait-seconds", 0.05).code == 1
    assert not Path("machine.json").exists()
    answer = runs.call("resume", "last", "--json")
    assert answer.code == 0, answer.err
    found = load_calibration(Path("machine.json"))
    assert found.response_counts == whole.response_counts
    assert found.response == whole.response
    assert len(runs.service.ledger().jobs) == 2


def test_a_calibration_resumed_later_keeps_the_time_it_was_measured(runs: Runs) -> None:
    """The file and both outputs have the time at which its job was sent."""
    runs.service.settings.queue_seconds = 0.2
    began = datetime.now(UTC).replace(microsecond=0)
    assert calibrated(runs, "--max-wait-seconds", 0.05, shots=100).code == 1
    [job] = runs.call("runs", "export", "last").json()["jobs"]
    sent_at = datetime.fromisoformat(job["sent_at"])
    assert sent_at >= began
    resumed = sent_at.replace(microsecond=0) + timedelta(seconds=1)
    while datetime.now(UTC) < resumed:
        time.sleep(0.05)
    answer = runs.call("resume", "last", "--json")
    assert answer.code == 0, answer.err
    found = load_calibration(Path("machine.json")).created
    assert found == sent_at.replace(microsecond=0) < resumed
    assert datetime.fromisoformat(answer.json()["created"]) == found
    shown = runs.call("runs", "show", "last", "--json").json()["result"]
    assert datetime.fromisoformat(shown["created"]) == found


def test_a_machine_that_did_not_move_passes_the_check(runs: Runs) -> None:
    assert calibrated(runs).code == 0
    runs.service.settings.seed = 1
    live = ("--live", "--max-qpu-seconds", 100, "--yes", "--json")
    words = ("calibrate", "--backend", "fake_lima", "--check", "machine.json", "--shots", SHOTS)
    answer = runs.call(*words, *live)
    assert answer.code == 0, answer.err
    assert answer.json()["check"]["drifted"] == []
