"""`qcompile calibrate --check`: whether a calibration still holds."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.calibration import load_calibration
from qcompile.device import load_device
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate
from qcompile.mitigation.measure import RESPONSE_ANGLES_RAD

Call = Callable[..., Any]

LIMA = ("calibrate", "--backend", "fake_lima", "--seed", 1)


def changed(name: str, **values: float) -> str:
    """A device file of fake_lima whose qubit 3 has other values, under the same device's name."""
    device = json.loads(load_device("fake_lima").to_json())
    device["qubits"][3] |= values
    Path(name).write_text(json.dumps(device))
    return name


def aged(name: str, hours: float) -> str:
    """The calibration of a file, as if it had been measured `hours` ago."""
    values = json.loads(Path(name).read_text())
    values["created"] = (datetime.now(UTC) - timedelta(hours=hours)).isoformat()
    Path(name).write_text(json.dumps(values))
    return name


def test_a_calibration_that_holds_passes(qcompile: Call, left: Call) -> None:
    qcompile(*LIMA, "--out", "old.json")
    before = Path("old.json").read_bytes()
    words = ("calibrate", "--backend", "fake_lima", "--check", "old.json", "--seed", 2)
    answer = qcompile(*words)
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.endswith("old.json is 0.0 hours old; drifted qubits: none\n")
    assert left() == ["old.json"]
    assert Path("old.json").read_bytes() == before
    found = qcompile(*words, "--json").json()
    assert found["file"] is None
    assert (found["check"]["file"], found["check"]["drifted"]) == ("old.json", [])


def test_a_file_of_version_0_1_is_checked_with_its_own_circuits(qcompile: Call) -> None:
    """All qubits turned alike: else what depends on neighbours would read as drift."""
    lima = OfflineExecutor(load_device("fake_lima"), 5)
    alike = np.repeat(RESPONSE_ANGLES_RAD[:, None], 5, axis=1)
    values = calibrate(lima, np.arange(5), 1000, angles_rad=alike).model_dump(mode="json")
    values["response_counts"]["angles_rad"] = RESPONSE_ANGLES_RAD.tolist()
    Path("old.json").write_text(json.dumps(values))
    words = ("--check", "old.json", "--qubits", "1,3", "--seed", 2, "--out", "new.json", "--json")
    answer = qcompile("calibrate", "--backend", "fake_lima", *words)
    assert (answer.code, answer.err) == (0, "")
    assert answer.json()["check"]["degrees"] == 2 + 8
    fresh = load_calibration(Path("new.json")).response_counts
    assert fresh is not None
    np.testing.assert_array_equal(fresh.angles, alike[:, :2])


def test_a_qubit_that_moved_is_found(qcompile: Call) -> None:
    qcompile(*LIMA, "--out", "old.json")
    worse = changed("now.json", p01=0.12)
    words = ("calibrate", "--backend", worse, "--check", "old.json", "--seed", 2, "--json")
    answer = qcompile(*words, "--out", "new.json")
    assert answer.code == 1
    assert answer.json()["check"]["drifted"] == [3]
    assert answer.err.startswith(
        "Error: old.json no longer holds.\n  Drifted qubits and their chi-square, "
    )
    assert load_calibration(Path("new.json")).qubits == (0, 1, 2, 3, 4)


def test_an_old_calibration_does_not_pass(qcompile: Call) -> None:
    qcompile(*LIMA, "--out", "old.json")
    words = ("calibrate", "--backend", "fake_lima", "--check", aged("old.json", 30), "--seed", 2)
    answer = qcompile(*words)
    assert answer.code == 1
    assert "\n  It is 30.0 hours old; the limit is 24.\n" in answer.err
    assert qcompile(*words, "--max-age-hours", 31).code == 0


def test_a_calibration_from_the_future_does_not_pass(qcompile: Call) -> None:
    qcompile(*LIMA, "--out", "old.json")
    words = ("calibrate", "--backend", "fake_lima", "--check", aged("old.json", -3), "--seed", 2)
    answer = qcompile(*words)
    assert answer.code == 1
    assert "\n  It is dated 3.0 hours in the future: a clock is wrong.\n" in answer.err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--backend", "ibm_lima"), "The calibration is of fake_lima, the backend is ibm_lima."),
        (("--qubits", "0,4"), "Qubit 4 has no calibration.\n  Calibrated on fake_lima: 0 1."),
        (("--parts", "response"), "The calibration has no counts of the response.\n  It has: re"),
    ],
)
def test_what_cannot_be_compared_is_refused_at_once(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], text: str
) -> None:
    qcompile(*LIMA, "--out", "old.json", "--qubits", "0,1", "--parts", "readout")
    monkeypatch.setattr(
        "qcompile.verbs.calibrate.measure_qubits", lambda *_, **__: pytest.fail("measured")
    )
    answer = qcompile(*LIMA, "--check", "old.json", *words)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: {text}")
