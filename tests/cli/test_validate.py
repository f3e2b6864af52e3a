"""`qcompile validate` as a user meets it, without any service."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]
WORDS = ("validate", "lima.json", "--policy", "cartpole", "--observations", 3, "--shots", 500)


@pytest.fixture(autouse=True)
def _calibrated(calibration: str) -> None:
    assert calibration == "lima.json"


def tamper() -> None:
    """Scale every qubit's curve by 0.8: many standard errors of a <Z>."""
    values = json.loads(Path("lima.json").read_text())
    for curve in values["response"]["curves"]:
        curve[1] *= 0.8
    Path("lima.json").write_text(json.dumps(values))


def test_the_contract_of_json(qcompile: Call) -> None:
    answer = qcompile(*WORDS, "--json")
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    assert set(found) == {
        *("file", "shots", "passed", "failed", "qubits", "chi_square", "degrees", "p_value"),
        *("largest_difference", "observations", "effect", "power", "least_power"),
        "calibration_misfits",
    }
    assert (found["observations"], found["effect"]) == (3, 0.05)
    assert len(found["power"]) == 4
    assert found["least_power"] == min(found["power"])
    assert (found["file"], found["shots"], found["passed"]) == ("lima.json", 500, True)
    assert found["degrees"] == [3] * 4
    assert len(found["qubits"]) == len(found["p_value"]) == len(found["chi_square"]) == 4
    assert qcompile(*WORDS, "--json").json() == found  # the same with the same seed
    assert qcompile(*WORDS, "--seed", 1, "--json").json() != found


def test_the_table(qcompile: Call) -> None:
    answer = qcompile(*WORDS)
    assert answer.code == 0
    assert "Twin of lima.json against fresh counts, 500 shots" in answer.out
    assert answer.out.count("holds") == 4
    assert "pass; the largest difference in <Z> is 0." in answer.out
    assert "charged" not in answer.out


def test_the_defaults_have_the_power_that_is_wanted(qcompile: Call) -> None:
    words = ("validate", "lima.json", "--policy", "cartpole")
    found = qcompile(*words, "--json").json()
    assert found["least_power"] >= 0.9
    told = " ".join(qcompile(*words).out.split())
    share = f"{100 * found['least_power']:.0f} %"
    assert (
        "observations: an increase of p01 by 0.05 on any one qubit is detected with a probability "
        f"of at least {share}"
    ) in told
    surer = qcompile(*words, "--power", 0.99, "--effect", 0.04, "--json").json()
    assert surer["least_power"] >= 0.99
    assert surer["effect"] == 0.04
    assert surer["shots"] * surer["observations"] > found["shots"] * found["observations"]


def test_a_twin_that_is_turned_can_be_validated(qcompile: Call) -> None:
    """Though its response cannot be undone; the device is not turned, and so it fails."""
    values = json.loads(Path("lima.json").read_text())
    for curve in values["response"]["curves"]:
        curve[1:] = [0.5 * curve[1], 0.5 * curve[1]]
    Path("lima.json").write_text(json.dumps(values))
    answer = qcompile(*WORDS, "--json")
    assert answer.code == 1
    assert answer.json()["failed"]
    assert "no longer matches the machine" in answer.err


def test_a_power_that_cannot_be_had_is_told(qcompile: Call) -> None:
    answer = qcompile("validate", "lima.json", "--policy", "cartpole", "--effect", 0.01, "--json")
    assert answer.code == 0
    share = f"{100 * answer.json()['least_power']:.0f} %"
    assert answer.err == (
        f"An increase of p01 by 0.01 is detected with a probability of only {share}: lima.json has "
        "too few shots. Calibrate with more.\n"
    )


def test_a_misfit_of_the_calibration_is_told(qcompile: Call) -> None:
    values = json.loads(Path("lima.json").read_text())
    values["response"]["chi_square"] = [500.0] * 5
    Path("lima.json").write_text(json.dumps(values))
    assert len(qcompile(*WORDS, "--json").json()["calibration_misfits"]) == 4
    tamper()
    answer = qcompile(*WORDS)
    assert answer.code == 1
    for text in (answer.out, answer.err):
        assert "does not depend on its own angle alone" in " ".join(text.split())


def test_a_twin_that_does_not_hold_is_printed_and_ends_with_1(qcompile: Call) -> None:
    tamper()
    answer = qcompile(*WORDS, "--json")
    assert answer.code == 1
    found = answer.json()
    assert found["passed"] is False
    assert found["failed"]
    answer = qcompile(*WORDS)
    assert answer.code == 1
    assert answer.out.count("fails") == len(found["failed"])
    assert answer.out.count("holds") == 4 - len(found["failed"])
    assert "fail; the largest difference in <Z> is 0." in answer.out
    assert (
        "Error: The twin of lima.json no longer matches the machine on qubit "
        f"{', '.join(map(str, found['failed']))}.\n"
    ) in answer.err


def test_another_device_and_a_missing_file_are_explained(qcompile: Call) -> None:
    answer = qcompile(*WORDS, "--backend", "fake_belem")
    assert (answer.code, answer.out) == (1, "")
    assert "The calibration belongs to fake_lima; the backend is fake_belem." in answer.err
    answer = qcompile("validate", "nowhere.json")
    assert (answer.code, answer.out) == (1, "")
    assert "nowhere.json" in answer.err


@pytest.mark.parametrize(
    "words",
    [
        *(("--shots", "exact"), ("--observations", 0), ("--observations", 1001)),
        *(("--power", 0.5), ("--power", 1), ("--effect", 0)),
        *(("--effect", "nan"), ("--effect", "inf")),
    ],
)
def test_wrong_usage(qcompile: Call, words: tuple[object, ...]) -> None:
    answer = qcompile(*WORDS, *words)
    assert (answer.code, answer.out) == (2, "")


@pytest.mark.parametrize("option", ["--power", "--effect"])
def test_a_share_that_is_no_number(qcompile: Call, option: str) -> None:
    answer = qcompile("validate", "lima.json", "--policy", "cartpole", option, "nan")
    assert (answer.code, answer.out) == (2, "")
    assert f"Invalid value for '{option}': 'nan' is not a number." in answer.err
