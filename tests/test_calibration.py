"""Calibration files: written, read back, and refused if they are damaged."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.calibration import (
    Calibration,
    fit_problems,
    is_calibration,
    load_calibration,
    load_counts,
)
from qcompile.device import IDEAL, load_device
from qcompile.errors import CalibrationError
from qcompile.execution import OfflineExecutor, load_backend
from qcompile.mitigation import calibrate

LIMA = calibrate(OfflineExecutor(load_device("fake_lima"), 0), np.array([4, 1, 2]), 1000)


@pytest.mark.parametrize("shots", [None, 200])
@pytest.mark.parametrize("parts", [["readout"], ["response"], ["readout", "response"]])
def test_a_file_holds_the_measurements(tmp_path: Path, shots: int | None, parts: Any) -> None:
    made = calibrate(OfflineExecutor(load_device("fake_lima"), 0), np.arange(5), shots, parts=parts)
    path = tmp_path / "new" / "lima.json"
    made.save(path)
    assert load_calibration(path) == made
    assert is_calibration(path)


def test_an_earlier_file_with_an_angle_for_each_circuit_is_used(tmp_path: Path) -> None:
    contents = json.loads(LIMA.model_dump_json())
    angles = [0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 2.0, 3.0]
    contents["response_counts"]["angles_rad"] = angles
    (tmp_path / "old.json").write_text(json.dumps(contents))
    old = load_calibration(tmp_path / "old.json")
    assert old.response_counts is not None
    np.testing.assert_array_equal(old.response_counts.angles, np.transpose([angles] * 3))
    assert old.response == LIMA.response


def test_counts_are_read_without_fits(tmp_path: Path) -> None:
    contents = json.loads(LIMA.model_dump_json())
    bare = LIMA.model_copy(update={"readout": None, "response": None})
    contents["response"]["curves"][0] = [0, 0, 0]
    (tmp_path / "a.json").write_text(json.dumps(contents))
    with pytest.raises(CalibrationError, match="preserves less than"):
        load_calibration(tmp_path / "a.json")
    assert load_counts(tmp_path / "a.json") == bare
    twice = json.dumps(contents)[:-1] + ', "created": "2020-01-01T00:00:00Z"}'
    for text in ("[1]", "{", "null", '"x"', "[" * 100_000, json.dumps({"readout": {}}), twice):
        (tmp_path / "a.json").write_text(text)
        with pytest.raises(CalibrationError, match=r"a\.json has no counts to fit"):
            load_counts(tmp_path / "a.json")


def test_a_contrast_whose_sign_is_not_known_needs_more_shots() -> None:
    """0.2 known to 0.09: nine in four of a third of it."""
    assert LIMA.readout is not None
    fit = LIMA.readout.model_copy(
        update={"p10": (0.4,) * 3, "p01": (0.4,) * 3, "p10_error": (0.09, 0, 0)}
    )
    first, second = fit_problems(fit, [1, 2, 4])
    times = math.ceil(10 * (fit.error[0] / (0.2 / 3)) ** 2) / 10
    assert "the readout of qubit 1 (0.0" in first
    assert first.endswith("is not known to a third of its contrast.")
    assert second == f"Use at least {times:g} times the shots."


def test_a_calibration_of_the_ideal_device_is_a_file_too(tmp_path: Path) -> None:
    made = calibrate(OfflineExecutor(IDEAL, 0), np.arange(2), 100)
    made.save(tmp_path / "a.json")
    assert load_calibration(tmp_path / "a.json").device == IDEAL


def test_other_files_are_none(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("qcompile-calibration-1")
    (tmp_path / "device.json").write_text(load_device("fake_lima").to_json())
    for name in ("text", "device.json", "missing", ".", "n" * 5000):
        assert not is_calibration(tmp_path / name)
    assert not is_calibration(Path("/dev/stdin"))


def test_a_calibration_is_known_by_its_format_wherever_that_stands(tmp_path: Path) -> None:
    contents = json.loads(LIMA.model_dump_json())
    path = tmp_path / "sorted.json"
    path.write_text(json.dumps(dict(reversed(contents.items()))))
    assert is_calibration(path)
    backend = load_backend(str(path))
    assert (backend.name, backend.calibration) == (str(path), LIMA)


@pytest.mark.parametrize("kind", ["a pipe", "a device", "a folder"])
def test_special_files_are_not_read(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "pipe"
    if kind == "a pipe":
        os.mkfifo(path)
    else:
        path = Path("/dev/zero") if kind == "a device" else tmp_path
    with pytest.raises(
        CalibrationError, match=r"is not a calibration\.\n  It is .*, not a regular"
    ):
        load_calibration(path)


Change = Callable[[dict[str, Any]], Any]
DAMAGES: dict[str, Change] = {
    "qubits must not be empty or repeated": lambda c: c.update(qubits=[1, 1, 4]),
    "has no qubit 5": lambda c: c.update(qubits=[1, 2, 5]),
    "a fit needs one entry for each of 2 qubits": lambda c: c.update(qubits=[1, 2]),
    "a row of counts needs one": lambda c: [
        row.pop() for name in ("prepared", "ones") for row in c["readout_counts"][name]
    ],
    "a row of angles_rad needs one angle": lambda c: c["response_counts"]["angles_rad"][2].pop(),
    "one row for each angle": lambda c: c["response_counts"]["ones"].pop(),
    "have different shapes": lambda c: c["readout_counts"]["ones"][0].pop(),
    "1001 ones in 1000 shots": lambda c: c["readout_counts"]["ones"][0].__setitem__(0, 1001),
    "readout_counts.prepared.0.0": lambda c: c["readout_counts"]["prepared"][0].__setitem__(0, 2),
    "readout.p10.1": lambda c: c["readout"]["p10"].__setitem__(1, 1.5),
    "readout of qubit 2 .* preserves less than 0.02": lambda c: c["readout"].update(
        p10=[0.4, 0.49, 0.4], p01=[0.4, 0.5, 0.4]
    ),
    "readout of qubit 4 .*0.0099.* less than": lambda c: c["readout"].update(
        p10=[0.5] * 3, p01=[0.4, 0.4, 0.49001]
    ),
    "readout of qubit 1 \\(0.201\\) is not known to 0.1": lambda c: c["readout"].update(
        p10_error=[0.2001, 0, 0]
    ),
    "p10_error.0: .* less than or equal to 1": lambda c: c["readout"].update(
        p10_error=[1e300, 0, 0]
    ),
    "degrees_of_freedom: .*greater than or equal to 0": lambda c: c["readout"].update(
        degrees_of_freedom=-1
    ),
    "readout_counts.shots: .*less than or equal to": lambda c: c["readout_counts"].update(
        shots=10**400
    ),
    "prepared in both": lambda c: c["readout_counts"].update(prepared=[], ones=[]),
    "was not prepared in both": lambda c: c["readout_counts"].update(prepared=[[0, 0, 1]] * 6),
    "one row for each angle, and at least one angle": lambda c: c["response_counts"].update(
        angles_rad=[], ones=[]
    ),
    "a covariance is not symmetric": lambda c: c["response"]["covariance"][1][0].__setitem__(2, 1),
    "negative variance": lambda c: c["response"]["covariance"][1][0].__setitem__(0, -1e-9),
    "or gives a negative": lambda c: c["response"]["covariance"].__setitem__(
        1, [[1e-4, 2e-4, 0], [2e-4, 1e-4, 0], [0, 0, 1e-4]]
    ),
    "response of qubit 2 \\(0.0141\\) preserves": lambda c: c["response"]["curves"].__setitem__(
        1, [0, 0.01, 0.01]
    ),
    "response of qubit 4 .* is not known": lambda c: c["response"]["covariance"].__setitem__(
        2, [[0.04, 0, 0], [0, 0, 0], [0, 0, 0]]
    ),
    "its device is 'fake_lima'": lambda c: c.update(backend="ibm_lima"),
    "fit needs one entry": lambda c: c["readout"]["chi_square"].append(0),
    "leaves \\[-1, 1\\]": lambda c: c["response"]["curves"][0].__setitem__(0, 0.5),
    "response of qubit 1 \\(0\\) preserves": lambda c: c["response"]["curves"].__setitem__(
        0, [0] * 3
    ),
    "response.covariance.0": lambda c: c["response"]["covariance"][0].pop(),
    "neither readout nor response": lambda c: c.update(
        readout=None, response=None, readout_counts=None, response_counts=None
    ),
    "created": lambda c: c.update(created="2026-01-02T03:04:05"),
    "kind": lambda c: c.update(kind="guess"),
    "more": lambda c: c.update(more=1),
    "format": lambda c: c.update(format="qcompile-calibration-2"),
    "backend": lambda c: c.update(backend="two\nlines"),
}


@pytest.mark.parametrize("words", DAMAGES)
def test_a_damaged_file_is_refused_in_words(tmp_path: Path, words: str) -> None:
    contents = json.loads(LIMA.model_dump_json())
    DAMAGES[words](contents)
    path = tmp_path / "damaged.json"
    path.write_text(json.dumps(contents))
    with pytest.raises(CalibrationError, match=f"(?s)damaged.json is not a calibration.*{words}"):
        load_calibration(path)


@pytest.mark.parametrize("contents", [b"", b"{", b"[]", b"\xff\xfe", b'{"format": NaN}'])
def test_invalid_json_is_refused(tmp_path: Path, contents: bytes) -> None:
    (tmp_path / "a").write_bytes(contents)
    with pytest.raises(CalibrationError, match="is not a calibration"):
        load_calibration(tmp_path / "a")


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="There is no calibration file"):
        load_calibration(tmp_path / "a")


def test_a_qubit_is_found_by_its_number() -> None:
    assert LIMA.qubits == (1, 2, 4)
    np.testing.assert_array_equal(LIMA.rows(np.array([4, 1, 4, 2])), [2, 0, 2, 1])
    mixed = LIMA.model_copy(update={"qubits": (4, 1, 2)})
    np.testing.assert_array_equal(mixed.rows(np.array([4, 1, 4, 2])), [0, 1, 0, 2])
    with pytest.raises(CalibrationError, match=r"Qubit 3 has no calibration\.\n  .* 1 2 4"):
        LIMA.rows(np.array([1, 3]))


def test_executions_and_age_by_hand() -> None:
    """6 patterns of 3 qubits and 8 angles, 1000 shots each; 90 minutes in another time zone."""
    assert LIMA.executions == 14_000
    born = datetime.fromisoformat("2026-01-02T10:00:00+00:00")
    calibration = LIMA.model_copy(update={"created": born})
    now = datetime(2026, 1, 2, 12, 30, tzinfo=timezone(timedelta(hours=1)))
    assert calibration.age_hours(now) == pytest.approx(1.5)
    assert isinstance(Calibration.model_validate_json(calibration.model_dump_json()), Calibration)
