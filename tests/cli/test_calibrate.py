"""`qcompile calibrate`: what it measures, shows and writes, and kept counts fitted anew."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qcompile.calibration import load_calibration
from qcompile.device import load_device
from qcompile.noise import unusable

Call = Callable[..., Any]

LIMA = ("calibrate", "--backend", "fake_lima", "--seed", 1)


def test_help_says_what_it_is_for(qcompile: Call) -> None:
    answer = qcompile("calibrate", "--help")
    assert (answer.code, answer.err) == (0, "")
    assert (
        "Measure the readout and response of a device's qubits, and write them to a" in answer.out
    )


def test_a_calibration_is_shown_and_written(qcompile: Call, left: Call) -> None:
    answer = qcompile(*LIMA, "--plot", "a.png")
    assert (answer.code, answer.err) == (0, "figure written to a.png\n")
    # 2 + 2 ceil(log2(5)) patterns and 8 angles, 8192 shots each
    assert answer.out.startswith("fake_lima: 8192 shots of each circuit, 131,072 executions")
    assert answer.out.endswith("calibration written to fake_lima-calibration.json\n")
    assert left() == ["a.png", "fake_lima-calibration.json"]
    assert Path("a.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    rows = [line.split() for line in answer.out.splitlines() if "±" in line]
    assert [row[0] for row in rows] == list("01234")


def test_the_json_document_holds_the_fits(qcompile: Call) -> None:
    answer = qcompile(*LIMA, "--qubits", "4,1, 1", "--out", "a.json", "--json")
    assert (answer.code, answer.err) == (0, "")
    found = answer.json()
    written = load_calibration(Path("a.json"))
    assert written.qubits == (1, 4)
    assert [row["qubit"] for row in found["qubits"]] == [1, 4]
    assert (found["file"], found["shots"]) == ("a.json", 8192)
    assert found["executions"] == written.executions == (4 + 8) * 8192
    for row in found["qubits"]:
        qubit = load_device("fake_lima").qubits[row["qubit"]]
        assert abs(row["p10"] - qubit.p10) < 6 * row["p10_error"]
        assert 0 < row["contrast_error"] < 0.01
        assert abs(row["tilt_rad"]) < 6 * row["tilt_error_rad"]


def test_a_sine_without_shots_is_found_exactly(qcompile: Call) -> None:
    words = (*LIMA, "--shots", "exact", "--parts", "response", "--json", "--plot", "a.png")
    found = qcompile(*words).json()
    assert (found["shots"], found["executions"]) == ("exact", 0)
    assert "p10" not in found["qubits"][0]
    again = qcompile(*words, "--backend", "fake_lima-calibration.json", "--force").json()
    contrasts = [[row["contrast"] for row in document["qubits"]] for document in (found, again)]
    np.testing.assert_allclose(*contrasts, atol=1e-6)
    assert found["qubits"][0]["response_p_value"] is None


@pytest.mark.parametrize(
    "words",
    [("--backend", "fake_toronto"), ("--qubits", "4", "--parts", "readout"), ("--qubits", "2")],
    ids=["many", "readout alone", "one"],
)
def test_pictures_of_any_size_are_drawn(qcompile: Call, words: tuple[str, ...]) -> None:
    answer = qcompile(*LIMA, "--shots", 200, "--plot", "a.png", *words)
    assert answer.code == 0
    assert Path("a.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_a_seed_repeats_the_counts(qcompile: Call) -> None:
    files = [f"{name}.json" for name in "abc"]
    for file, seed in zip(files, (5, 5, 6), strict=True):
        assert qcompile(*LIMA, "--seed", seed, "--shots", 100, "--out", file).code == 0
    a, b, c = (load_calibration(Path(file)) for file in files)
    assert (a.readout, a.response) == (b.readout, b.response)
    assert a.response != c.response


def test_the_qubits_of_a_policy_are_measured(qcompile: Call, policy: Call) -> None:
    words = ("calibrate", "--backend", "fake_toronto", "--policy", policy(), "--shots", 100)
    found = qcompile(*words, "--json").json()
    shown = qcompile("show", "tiny.json", "--backend", "fake_toronto", "--json").json()
    placed = sorted({row["qubit"] for row in shown["circuits"]})
    assert [row["qubit"] for row in found["qubits"]] == placed


def test_ideal_needs_none(qcompile: Call) -> None:
    answer = qcompile("calibrate", "--backend", "ideal")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: ideal needs no calibration: it has no errors.\n")
    found = qcompile("calibrate", "--backend", "ideal", "--qubits", "0,3", "--json").json()
    assert all(row["contrast"] > 0.999 for row in found["qubits"])


def test_a_bad_fit_is_told_in_words(qcompile: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    from qcompile.mitigation import measure

    ones = measure._ones

    def drifting(executor: Any, executable: Any, turns: Any, shots: Any) -> Any:
        found = ones(executor, executable, turns, shots)
        if turns is not None:
            found[-1, 3] += 400  # qubit 3 jumps at the last angle
        return found

    monkeypatch.setattr(measure, "_ones", drifting)
    answer = qcompile(*LIMA)
    assert (answer.code, answer.err) == (0, "")
    assert "The response of qubit 3 does not depend on its own angle alone, or" in answer.out
    assert answer.out.count("p-value") == 1


def test_qubits_that_are_not_measured_are_named(qcompile: Call) -> None:
    answer = qcompile("calibrate", "--backend", "fake_lagos", "--shots", 100, "--json")
    assert answer.code == 0
    reasons = unusable(load_device("fake_lagos"))
    for qubit, why in reasons.items():
        assert f"{qubit} {why}" in " ".join(answer.err.split())
    assert not {row["qubit"] for row in answer.json()["qubits"]} & set(reasons)
    words = ("--qubits", "0", "--force", "--json")
    assert qcompile("calibrate", "--backend", "fake_lagos", *words).err == ""


# Kept counts.


def test_counts_whose_fits_failed_are_fitted_anew(
    qcompile: Call, left: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    from qcompile.mitigation import cone

    with monkeypatch.context() as failing:
        nothing = (np.zeros((1, 3)), np.array([np.nan]))
        failing.setattr(cone, "_solve", lambda *_: nothing)
        words = ("calibrate", "--backend", "ideal", "--qubits", "0,1,2,3", "--seed", 37)
        answer = qcompile(*words, "--out", "paid.json")
    assert answer.code == 1
    assert "No solver finds the response curve of qubit" in answer.err
    monkeypatch.setattr(
        "qcompile.verbs.calibrate.measure_qubits", lambda *_, **__: pytest.fail("measured")
    )
    answer = qcompile("calibrate", "--from", "paid.json", "--plot", "a.png", "--json")
    assert (answer.code, answer.err) == (0, "figure written to a.png\n")
    assert left() == ["a.png", "ideal-calibration.json", "paid.json"]
    paid, fitted = (load_calibration(Path(name)) for name in ("paid.json", left()[1]))
    assert paid.response is None
    assert fitted.response is not None
    assert (fitted.created, fitted.response_counts) == (paid.created, paid.response_counts)
    assert answer.json()["file"] == "ideal-calibration.json"
    assert answer.json()["executions"] == paid.executions
    assert all(row["contrast"] > 0.999 for row in answer.json()["qubits"])


def test_kept_counts_of_some_qubits(qcompile: Call) -> None:
    assert qcompile(*LIMA, "--out", "a.json").code == 0
    words = ("calibrate", "--from", "a.json", "--qubits", "1,4")
    assert qcompile(*words, "--out", "b.json").out.endswith("calibration written to b.json\n")
    assert load_calibration(Path("b.json")).qubits == (1, 4)
    answer = qcompile(*words, "--out", "a.json")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: a.json already exists.\n")
    assert qcompile(*words, "--out", "a.json", "--force").code == 0
    assert load_calibration(Path("a.json")) == load_calibration(Path("b.json"))
    answer = qcompile("calibrate", "--from", "a.json", "--qubits", "2", "--out", "c.json")
    assert (answer.code, answer.out) == (1, "")
    assert "Qubit 2 has no calibration.\n  Calibrated on fake_lima: 1 4" in answer.err


@pytest.mark.usefixtures("nothing_is_measured")
@pytest.mark.parametrize(
    "words",
    [
        *(("--backend", "fake_lima"), ("--shots", 8192), ("--seed", 1), ("--check", "a.json")),
        *(("--parts", "readout"), ("--live", "--max-qpu-seconds", 9), ("--policy", "cartpole")),
        ("--max-age-hours", 3),
    ],
    ids=lambda words: words[0],
)
def test_fitting_anew_measures_nothing(qcompile: Call, words: tuple[object, ...]) -> None:
    answer = qcompile("calibrate", "--from", "a.json", *words)
    assert (answer.code, answer.out) == (2, "")
    assert f"{words[0]} cannot be used with --from: nothing is run." in answer.err


def test_fitting_anew_takes_no_option_of_live(qcompile: Call) -> None:
    answer = qcompile("calibrate", "--from", "a.json", "--max-qpu-seconds", 9)
    assert (answer.code, answer.out) == (2, "")
    assert "--max-qpu-seconds needs --live." in answer.err


def test_what_has_no_counts_is_not_fitted(qcompile: Call) -> None:
    Path("a.json").write_text(load_device("fake_lima").to_json())
    answer = qcompile("calibrate", "--from", "a.json")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: a.json has no counts to fit.\n")
    answer = qcompile("calibrate")
    assert (answer.code, answer.out) == (2, "")
    assert "Give --backend NAME to measure a device" in answer.err


# Other commands.


def test_a_calibration_on_the_shelf_is_no_backend_of_the_list(qcompile: Call) -> None:
    qcompile(*LIMA, "--out", "hardware/mine.json", "--shots", 100)
    assert "mine" not in qcompile("backends").out
    answer = qcompile("backends", "show", "mine")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: hardware/mine.json is a calibration, not a device file.\n")


def test_circuits_are_compiled_for_a_twin(qcompile: Call, policy: Call) -> None:
    qcompile(*LIMA, "--out", "a.json", "--shots", 100, "--qubits", "0,1")
    found = qcompile("show", policy(), "--backend", "a.json", "--json").json()
    assert {row["qubit"] for row in found["circuits"]} == {0, 1}
    assert found["left_out"] == [
        {"qubit": qubit, "reason": "was not calibrated"} for qubit in (2, 3, 4)
    ]
    assert qcompile("export", "tiny.json", "--backend", "a.json", "--out", "job").code == 0
