"""`qcompile.calibrate`: whatever names a backend, and checks and new fits of calibrations."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import qcompile
from qcompile.calibration import Calibration
from qcompile.device import load_device
from qcompile.errors import CalibrationError, OptionError
from qcompile.execution import OfflineExecutor, load_backend
from qcompile.verbs.calibrate import calibrate_into, check_calibration, refit
from qcompile.verbs.calibration_request import CalibrationRequest

LIMA = load_device("fake_lima")


def test_a_name_a_device_a_backend_and_an_executor_are_the_same_backend() -> None:
    named = qcompile.calibrate("fake_lima", shots=400, seed=5)
    assert named.qubits == (0, 1, 2, 3, 4)
    for backend in (LIMA, load_backend("fake_lima"), OfflineExecutor(LIMA, 5)):
        other = qcompile.calibrate(backend, shots=400, seed=5)
        assert other.model_copy(update={"created": named.created}) == named


def test_earlier_calls_go_on_working() -> None:
    calibration = qcompile.calibrate(OfflineExecutor(LIMA, 0), np.array([3, 1]), shots=None)
    assert calibration.qubits == (1, 3)
    assert calibration.readout is not None
    assert calibration.readout.p10 == pytest.approx([LIMA.qubits[q].p10 for q in (1, 3)])


def test_a_calibration_mitigates_and_is_a_backend() -> None:
    calibration = qcompile.calibrate(LIMA, shots=1000, seed=0)
    mitigated = qcompile.run("cartpole", LIMA, episodes=1, max_steps=3, calibration=calibration)
    assert mitigated.to_dict()["mitigation"] == "readout"
    twin = qcompile.run("cartpole", calibration, episodes=1, max_steps=3).to_dict()
    assert twin["kind"] == "measured-response"


def test_parts_and_the_qubits_of_a_policy() -> None:
    toronto = load_device("fake_toronto")
    calibration = qcompile.calibrate(toronto, shots=300, policy="cartpole", parts="readout")
    assert calibration.response is None
    policy = qcompile.load_policy("cartpole")
    placed = qcompile.compile(policy.trained_program, toronto, 2, policy.importance).qubits
    assert calibration.qubits == tuple(sorted(set(placed.tolist())))


def test_counts_that_cannot_be_fitted_are_kept_and_told() -> None:
    told: list[str] = []
    calibration = qcompile.calibrate(LIMA, shots=2, seed=1, on_note=told.append)
    assert calibration.readout is None
    assert told == list(calibration.unfitted)
    assert told[0].startswith("Too few shots: the readout of qubit 0")


def test_it_is_short_and_has_a_picture() -> None:
    calibration = qcompile.calibrate(LIMA, [0, 2], shots=300)
    assert repr(calibration) == str(calibration)
    assert repr(calibration).startswith("Calibration(fake_lima, 2 qubits, readout and response, ")
    assert calibration._repr_html_().count("<tr>") == 1 + 2
    assert calibration.plot().png[:8] == b"\x89PNG\r\n\x1a\n"


def test_a_check_finds_the_qubit_that_moved() -> None:
    old = qcompile.calibrate(LIMA, shots=4000, seed=0)
    same = check_calibration(old, CalibrationRequest(LIMA, shots=4000, seed=1))
    assert same.holds
    same.check_holds()
    worse = LIMA.qubits[3].model_copy(update={"p01": 0.15})
    moved = LIMA.model_copy(update={"qubits": (*LIMA.qubits[:3], worse, LIMA.qubits[4])})
    found = check_calibration(old, CalibrationRequest(moved, shots=4000, seed=1))
    assert found.to_dict()["check"]["drifted"] == [3]
    with pytest.raises(CalibrationError, match="the calibration of fake_lima no longer holds"):
        found.check_holds()
    assert list(Path().iterdir()) == []


def test_kept_counts_are_fitted_anew() -> None:
    kept = calibrate_into(CalibrationRequest(LIMA, shots=500, seed=0))
    assert kept.file == Path("fake_lima-calibration.json")
    fitted = refit(kept.file, [1, 4], out="two.json", plot="two.png")
    assert fitted.calibration.qubits == (1, 4)
    counts, readout = kept.calibration.readout_counts, fitted.calibration.readout
    assert counts is not None
    assert readout is not None
    zeros = np.array(counts.prepared)[:, [1, 4]] == 0
    ones = (np.array(counts.ones)[:, [1, 4]] * zeros).sum(axis=0) / zeros.sum(axis=0)
    assert readout.p10 == pytest.approx(ones / 500, abs=1e-3)
    assert Calibration.model_validate_json(Path("two.json").read_text()) == fitted.calibration
    assert Path("two.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"qubits": [0], "policy": "cartpole"}, "qubits and policy cannot be combined"),
        ({"parts": "all"}, "'all' is neither readout nor response."),
        ({"live": qcompile.Live(9), "shots": None}, "shots exact cannot be combined with live."),
        ({"live": qcompile.Live(9), "seed": 1}, "seed cannot be combined with live."),
        ({"live": qcompile.Live(9)}, "A live calibration needs the name of an IBM machine."),
    ],
)
def test_contradictions_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError) as error:
        qcompile.calibrate(LIMA, **options)
    assert str(error.value).startswith(words)


@pytest.mark.parametrize("qubits", [[], [0, 7]])
def test_qubits_that_are_not_there_are_refused(qubits: list[int]) -> None:
    with pytest.raises(CalibrationError, match="no qubit"):
        qcompile.calibrate(LIMA, qubits)


def test_a_backend_of_qiskit() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        provider = pytest.importorskip("qiskit_ibm_runtime.fake_provider")
        backend = provider.FakeLimaV2()
    calibration = qcompile.calibrate(backend, [2], shots=None, parts="readout")
    assert calibration.readout is not None
    assert calibration.readout.p10 == pytest.approx([LIMA.qubits[2].p10])
