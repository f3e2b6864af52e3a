"""`qcompile run` with calibrations, twins, predistorted angles and copies."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qcompile.device import load_device

Call = Callable[..., Any]

LIMA = ("--backend", "fake_lima", "--episodes", 2)


@pytest.mark.parametrize("mitigation", ["readout", "response"])
def test_a_calibration_of_a_file_costs_nothing_again(
    qcompile: Call, policy: Call, calibration: str, mitigation: str
) -> None:
    words = ("run", policy(), *LIMA, "--mitigation", mitigation, "--json")
    answer = qcompile(*words, "--calibration", calibration)
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    assert (found["mitigation"], found["calibration"]) == (mitigation, calibration)
    assert found["executions"] == 8192 * found["env_steps"]
    measured = qcompile(*words).json()
    assert measured["calibration"] is None
    circuits = {"readout": 6, "response": 8}[mitigation]  # 4 qubits: 2 + 2 log2(4) patterns
    assert measured["executions"] == 8192 * (measured["env_steps"] + circuits)


def test_a_twin_plays_its_calibration(qcompile: Call, policy: Call, calibration: str) -> None:
    words = ("run", policy(), "--backend", calibration, "--episodes", 2)
    found = qcompile(*words, "--json").json()
    assert (found["backend"], found["kind"]) == ("fake_lima", "measured-response")
    assert found["mitigation"] == "readout"
    assert found["executions"] == 8192 * found["env_steps"]  # its own calibration mitigates
    again = qcompile(*words, "--json", "--shots", "exact", "--mitigation", "response").json()
    assert (again["shots"], again["mitigation"]) == ("exact", "response")
    assert "on fake_lima (twin of a calibration)" in qcompile(*words).out


def test_bent_angles_are_not_undone(qcompile: Call, policy: Call, calibration: str) -> None:
    words = ("run", policy(), *LIMA, "--predistort", "--calibration", calibration)
    found = qcompile(*words, "--json").json()
    assert (found["predistort"], found["mitigation"]) == (True, "none")
    assert "predistorted angles from lima.json" in qcompile(*words).out


def test_copies_share_executions(qcompile: Call, policy: Call) -> None:
    narrow = policy(
        circuits=[[["ry", "x0"]]] * 2, weights=[[1.0] * 2, [0.0] * 2], theta=[], bias=[0.0, 0.0]
    )
    words = ("run", narrow, "--backend", "fake_lima", "--mitigation", "none", "--episodes", 2)
    found = qcompile(*words, "--copies", 2, "--shots", 100, "--json").json()
    assert (found["copies"], found["rounds_per_step"]) == (2, 1)
    longest = max(episode["length"] for episode in found["episodes"])
    assert found["executions"] == 100 * longest
    assert (
        "copies       2 on the device at once, each with its own episode"
        in qcompile(*words, "--copies", 2).out
    )


def test_an_old_calibration_is_reported(qcompile: Call, policy: Call, calibration: str) -> None:
    values = json.loads(Path(calibration).read_text())
    Path("old.json").write_text(json.dumps(values | {"created": "2020-01-01T00:00:00Z"}))
    answer = qcompile("run", policy(), *LIMA, "--calibration", "old.json", "--json")
    assert answer.code == 0
    assert answer.err.startswith("old.json is ")
    assert " hours old; check it with `qcompile calibrate " in answer.err
    assert answer.json()["calibration"] == "old.json"


def doubt(file: str, qubits: list[int]) -> None:
    """Make the response of these qubits a misfit: chi-square 500 for its five degrees."""
    values = json.loads(Path(file).read_text())
    for qubit in qubits:
        values["response"]["chi_square"][values["qubits"].index(qubit)] = 500.0
    Path(file).write_text(json.dumps(values))


@pytest.mark.parametrize(
    "words",
    [
        ("--backend", "fake_lima", "--calibration", "lima.json", "--mitigation", "response"),
        ("--backend", "fake_lima", "--calibration", "lima.json", "--predistort"),
        ("--backend", "lima.json", "--mitigation", "response"),
        ("--backend", "lima.json", "--mitigation", "none"),
    ],
    ids=["response", "predistorted", "twin", "bare twin"],
)
def test_misfits_of_the_qubits_in_use_are_told(
    qcompile: Call, policy: Call, calibration: str, words: tuple[str, ...]
) -> None:
    """The policy has four circuits for five qubits."""
    shown = qcompile("show", policy(), "--backend", calibration, "--json").json()
    used = sorted({row["qubit"] for row in shown["circuits"]})
    (unused,) = {*range(5)} - {*used}
    doubt(calibration, [used[1], unused])
    words = ("run", "tiny.json", *words, "--episodes", "1", "--max-steps", "2")
    found = qcompile(*words, "--json").json()["calibration_misfits"]
    assert [(misfit["qubit"], misfit["part"]) for misfit in found] == [(used[1], "response")]
    assert 0 < found[0]["p_value"] < 1e-90
    told = " ".join(qcompile(*words).out.split())
    assert f"The response of qubit {used[1]} does not depend on its own angle alone" in told
    assert "Use other qubits" in told


def test_what_is_not_in_use_is_not_told(qcompile: Call, policy: Call, calibration: str) -> None:
    doubt(calibration, [0, 1, 2, 3, 4])
    words = ("run", policy(), *LIMA, "--calibration", calibration, "--max-steps", 2)
    assert qcompile(*words, "--mitigation", "readout", "--json").json()["calibration_misfits"] == []
    assert "warning" not in qcompile(*words, "--mitigation", "readout").out


@pytest.mark.parametrize("words", [("response",), ("readout",), ("none", "--predistort")])
@pytest.mark.parametrize("gate", ["sx", "rx"])
def test_a_device_whose_bits_are_swapped_is_undone(
    qcompile: Call, words: tuple[str, ...], gate: str
) -> None:
    """0 is read as 1 and 1 as 0: without mitigation the pole falls in ten steps."""
    device = json.loads(load_device("fake_lima").to_json())
    names = {"sx": ["rz", "sx", "x"], "rx": ["rz", "rx"]}[gate]
    device |= {"name": "swapped", "basis_gates": names}
    for qubit in device["qubits"]:
        qubit |= {"p10": 0.97, "p01": 0.96}
        qubit["gates"] = dict.fromkeys(names[1:], qubit["gates"]["sx"])
    Path("swapped.json").write_text(json.dumps(device))
    run = ("run", "cartpole", "--backend", "swapped.json", "--episodes", 2, "--max-steps", 60)
    found = qcompile(*run, "--mitigation", *words, "--json").json()
    assert found["mean_reward"] == 60
    assert qcompile(*run, "--mitigation", "none", "--json").json()["mean_reward"] < 20


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (
            ("--backend", "ibm_lima", "--calibration", "lima.json"),
            "The calibration belongs to fake_lima; the backend is ibm_lima.\n  Measure one with",
        ),
        (
            ("--mitigation", "response", "--level", "1", "--calibration", "lima.json"),
            "Response curves need level 2, found level 1.",
        ),
        (
            ("--predistort", "--level", "1"),
            "Response curves need level 2, found level 1.\n  They describe sx rz sx; use "
            "--level 2, or --mitigation readout without --predistort.",
        ),
        (("--calibration", "bad.json"), "bad.json is not a calibration.\n  It is not JSON: line 1"),
        (("--calibration", "nosuch.json"), "There is no calibration file nosuch.json.\n"),
        (
            ("--calibration", "two.json"),
            "Qubit 2 has no calibration.\n  Calibrated on fake_lima: 0",
        ),
        (
            ("--calibration", "two.json", "--mitigation", "response"),
            "Qubit 2 has no calibration.\n",
        ),
        (("--backend", "two.json"), "The calibration of fake_lima has no response curves.\n"),
        (("--backend", "lima.json", "--level", "1"), "A twin runs sx rz sx, found "),
    ],
)
def test_calibrations_that_do_not_fit_are_explained(
    qcompile: Call, policy: Call, calibration: str, words: tuple[str, ...], text: str
) -> None:
    two = ("calibrate", "--backend", "fake_lima", "--qubits", "0,1", "--parts", "readout")
    assert qcompile(*two, "--out", "two.json").code == 0
    Path("bad.json").write_text(Path(calibration).read_text()[:300])
    answer = qcompile("run", policy(), *LIMA, *words)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: {text}")


def test_a_sampler_has_shots_alone(qcompile: Call, policy: Call) -> None:
    answer = qcompile("run", policy(), "--backend", "qiskit:FakeLimaV2", "--shots", "exact")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: fake_lima runs through a sampler, which needs shots.\n")


def test_a_device_that_cannot_be_calibrated_is_named(qcompile: Call, policy: Call) -> None:
    """No file was given: the message does not speak of one."""
    device = json.loads(load_device("fake_lima").to_json())
    for qubit in device["qubits"]:
        qubit |= {"p10": 0.5, "p01": 0.5}
    Path("dead.json").write_text(json.dumps(device | {"name": "dead"}))
    answer = qcompile("run", policy(), "--backend", "dead.json")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(
        "Error: The readout of dead cannot be calibrated.\n  The readout of qubit "
    )
    assert ") preserves less than 0.02 of <Z>, so its errors cannot be undone." in answer.err


def test_a_row_is_split_over_places(qcompile: Call) -> None:
    """Six places of lunarlander's 24 circuits on 155 qubits: 11 shots an execution for 64."""
    words = ("run", "lunarlander", "--backend", "fake_fez", "--shots", 64, "--episodes", 1)
    words += ("--max-steps", 5, "--split", "--calibration-shots", "auto", "--json")
    found = qcompile(*words).json()
    known = {"split": True, "copies": 6, "shots": 64, "calibration_shots": 256, "jobs": 6}
    assert {name: found[name] for name in known} == known
    # 144 qubits: 2 + 2 * 8 patterns.
    assert found["executions"] == 5 * 11 + 18 * 256
    table = qcompile(*words[:-1]).out
    assert (
        "64 shots split over 6 copies, level 2, mitigation readout calibrated with 256 shots"
        in " ".join(table.split())
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--split", "--copies", 1), "over several copies; --copies is 1"),
        (("--copies", 3), "--split spreads the shots of an episode over copies."),
    ],
)
def test_a_split_that_makes_no_sense(qcompile: Call, words: tuple[Any, ...], said: str) -> None:
    answer = qcompile("run", "cartpole", "--backend", "fake_toronto", "--episodes", 2, *words)
    assert (answer.code, said in answer.err) == (2, True)


@pytest.mark.parametrize("value", ["0", "many", "1.5"])
def test_calibration_shots_are_a_number_or_auto(qcompile: Call, value: str) -> None:
    answer = qcompile("run", "cartpole", "--calibration-shots", value)
    assert (answer.code, "--calibration-shots" in answer.err) == (2, True)
