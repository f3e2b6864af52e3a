"""`qcompile calibrate`: what it measures, shows, writes, compares and refuses."""

from __future__ import annotations

import json
import signal
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
from qcompile.noise import unusable

Call = Callable[..., Any]

LIMA = ("calibrate", "--backend", "fake_lima", "--seed", 1)


@pytest.fixture
def nothing_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    def calibrate(*_: object, **__: object) -> None:
        pytest.fail("measured before the words were checked")

    monkeypatch.setattr("qcompile.mitigation.calibrate", calibrate)


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


def test_help_says_what_it_is_for(qcompile: Call) -> None:
    answer = qcompile("calibrate", "--help")
    assert (answer.code, answer.err) == (0, "")
    assert "Measure the readout and the response of a device's qubits, and fit them." in answer.out


def test_a_calibration_is_shown_and_written(qcompile: Call, left: Call) -> None:
    answer = qcompile(*LIMA, "--plot", "a.png")
    assert (answer.code, answer.err) == (0, "")
    # 2 + 2 ceil(log2(5)) patterns and 8 angles, 8192 shots each
    assert answer.out.startswith("fake_lima: 8192 shots of each circuit, 131,072 executions")
    assert answer.out.endswith("calibration in fake_lima-calibration.json\npicture in a.png\n")
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
    assert "The response of qubit 3 is not a curve of its own angle alone, or" in answer.out
    assert answer.out.count("p-value") == 1


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
    monkeypatch.setattr("qcompile.mitigation.calibrate", lambda *_, **__: pytest.fail("measured"))
    answer = qcompile("calibrate", "--from", "paid.json", "--plot", "a.png", "--json")
    assert (answer.code, answer.err) == (0, "")
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
    assert qcompile(*words, "--out", "b.json").out.endswith("calibration in b.json\n")
    assert load_calibration(Path("b.json")).qubits == (1, 4)
    answer = qcompile(*words, "--out", "a.json")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: a.json is there already.\n")
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
        *(("--max-age-hours", 3), ("--max-qpu-seconds", 9)),
    ],
    ids=lambda words: words[0],
)
def test_fitting_anew_measures_nothing(qcompile: Call, words: tuple[object, ...]) -> None:
    answer = qcompile("calibrate", "--from", "a.json", *words)
    assert (answer.code, answer.out) == (2, "")
    assert f"{words[0]} is for" in answer.err


def test_what_has_no_counts_is_not_fitted(qcompile: Call) -> None:
    Path("a.json").write_text(load_device("fake_lima").to_json())
    answer = qcompile("calibrate", "--from", "a.json")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: a.json holds no counts to fit.\n")
    answer = qcompile("calibrate")
    assert (answer.code, answer.out) == (2, "")
    assert "--backend names what to measure" in answer.err


# Checks.


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
    assert answer.err.startswith("Error: old.json no longer holds.\n  Drifted: 3 (")
    assert load_calibration(Path("new.json")).qubits == (0, 1, 2, 3, 4)


def test_an_old_calibration_does_not_pass(qcompile: Call) -> None:
    qcompile(*LIMA, "--out", "old.json")
    words = ("calibrate", "--backend", "fake_lima", "--check", aged("old.json", 30), "--seed", 2)
    answer = qcompile(*words)
    assert answer.code == 1
    assert "\n  It is 30.0 hours old, more than 24.\n" in answer.err
    assert qcompile(*words, "--max-age-hours", 31).code == 0


def test_a_calibration_from_the_future_does_not_pass(qcompile: Call) -> None:
    qcompile(*LIMA, "--out", "old.json")
    words = ("calibrate", "--backend", "fake_lima", "--check", aged("old.json", -3), "--seed", 2)
    answer = qcompile(*words)
    assert answer.code == 1
    assert "\n  It is from the future, by 3.0 hours: a clock is wrong.\n" in answer.err


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
    monkeypatch.setattr("qcompile.mitigation.calibrate", lambda *_, **__: pytest.fail("measured"))
    answer = qcompile(*LIMA, "--check", "old.json", *words)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: {text}")


# What is refused.


@pytest.mark.usefixtures("nothing_is_measured")
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--qubits", "0", "--policy", "x"), "--qubits and --policy exclude each other"),
        (("--qubits", "0,x"), "'0,x' is no list of qubits such as 0,1,5."),
        (("--qubits", "-1"), "'-1' is no list of qubits such as 0,1,5."),
        (("--parts", "all"), "'all' is neither readout nor response."),
        (("--plot", "a.pdf"), "a.pdf must end with .png."),
        (("--check", "a.json", "--shots", "exact"), "--shots exact has none"),
        (("--shots", "0"), "0 shots cannot be run"),
        (("--max-age-hours", "0"), "0.0 is not in the range x>0"),
        (("--max-age-hours", "nan"), "'nan' is not a number of hours."),
        (("--max-age-hours", "2"), "--max-age-hours is for --check"),
        (("--check", "a.json", "--force"), "--check writes none without --out"),
        (("--out", "a.png", "--plot", "x/../a.png"), "x/../a.png is the file of --out."),
        (("--check", "a.png", "--plot", "a.png"), "a.png is the file of --check."),
    ],
)
def test_wrong_usage(qcompile: Call, words: tuple[str, ...], text: str) -> None:
    answer = qcompile(*LIMA, *words)
    assert (answer.code, answer.out) == (2, "")
    assert text in answer.err


@pytest.mark.usefixtures("nothing_is_measured")
def test_a_file_that_is_there_is_kept(qcompile: Call) -> None:
    Path("fake_lima-calibration.json").write_text("paid for")
    answer = qcompile(*LIMA)
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: fake_lima-calibration.json is there already.
  It may have been paid for: choose another with --out, or overwrite it with --force.
"""
    )


def test_force_overwrites(qcompile: Call) -> None:
    Path("a.json").write_text("old")
    assert qcompile(*LIMA, "--out", "a.json", "--force", "--shots", 100).code == 0
    assert load_calibration(Path("a.json")).backend == "fake_lima"


@pytest.mark.usefixtures("nothing_is_measured")
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--qubits", "0,7"), "fake_lima has no qubit 7.\n  Its qubits are 0 to 4.\n"),
        (("--backend", "nosuch"), "Unknown backend 'nosuch'.\n"),
        (("--policy", "nosuch"), "Unknown policy 'nosuch'.\n"),
        (("--check", "bad.json"), "bad.json is no calibration.\n  It is not JSON: line 1"),
        (("--backend", "bad.json"), "bad.json is no calibration.\n  It is not JSON: line 1"),
        (("--check", "nosuch.json"), "nosuch.json is no calibration.\n"),
        (("--out", "bad.json/a.json"), "Cannot write bad.json/a.json.\n"),
        (("--plot", "bad.json/a.png"), "Cannot write bad.json/a.png.\n"),
    ],
)
def test_what_cannot_work_is_explained_at_once(
    qcompile: Call, left: Call, words: tuple[str, ...], text: str
) -> None:
    Path("bad.json").write_text('{"format": "qcompile-calibration-1", "backend": ')
    answer = qcompile(*LIMA, *words)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: {text}")
    assert left() == ["bad.json"]


def test_too_few_shots_are_refused_and_kept(qcompile: Call, left: Call) -> None:
    answer = qcompile(*LIMA, "--shots", 2)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: Not everything could be fitted. The counts are in fake_")
    assert "\n  Too few shots: the readout of qubit 0 (0." in answer.err
    assert "\n  Too few shots: the response of qubit 0 (0." in answer.err
    assert left() == ["fake_lima-calibration.json"]
    kept = json.loads(Path("fake_lima-calibration.json").read_text())
    assert kept["readout"] is kept["response"] is None
    assert len(kept["response_counts"]["ones"]) == 8
    answer = qcompile(
        "run", "cartpole", "--backend", "fake_lima", "--calibration", "fake_lima-calibration.json"
    )
    assert answer.code == 1
    assert answer.err.startswith("Error: The calibration holds no assignment matrices.\n  Too few")
    assert "mitigation response" not in answer.err, "it has no response either"
    answer = qcompile("calibrate", "--backend", "fake_lima", "--check", left()[0])
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: The calibration has no fit of its readout")
    assert "\n  Too few shots: the readout of qubit 0 (0." in answer.err


def test_ctrl_c_writes_nothing(qcompile: Call, left: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def fit(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("qcompile.mitigation.measure.fit_readout", fit)
    answer = qcompile(*LIMA, "--plot", "a.png")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err == "Error: Interrupted: nothing was written.\n"
    assert left() == []


def test_ctrl_c_while_the_picture_is_drawn_keeps_the_calibration(
    qcompile: Call, left: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def draw(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("qcompile.report.calibration.draw_calibration", draw)
    answer = qcompile(*LIMA, "--plot", "a.png", "--out", "a.json")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err == "Error: Interrupted: a.png was not drawn. The calibration is in a.json.\n"
    assert left() == ["a.json"]


def test_qubits_that_are_not_measured_are_named(qcompile: Call) -> None:
    answer = qcompile("calibrate", "--backend", "fake_lagos", "--shots", 100, "--json")
    assert answer.code == 0
    reasons = unusable(load_device("fake_lagos"))
    for qubit, why in reasons.items():
        assert f"{qubit} {why}" in " ".join(answer.err.split())
    assert not {row["qubit"] for row in answer.json()["qubits"]} & set(reasons)
    words = ("--qubits", "0", "--force", "--json")
    assert qcompile("calibrate", "--backend", "fake_lagos", *words).err == ""


# Other commands.


def test_a_calibration_on_the_shelf_is_no_backend_of_the_list(qcompile: Call) -> None:
    qcompile(*LIMA, "--out", "hardware/mine.json", "--shots", 100)
    assert "mine" not in qcompile("backends").out
    answer = qcompile("backends", "show", "mine")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: hardware/mine.json is a calibration, no device file.\n")


def test_circuits_are_compiled_for_a_twin(qcompile: Call, policy: Call) -> None:
    qcompile(*LIMA, "--out", "a.json", "--shots", 100, "--qubits", "0,1")
    found = qcompile("show", policy(), "--backend", "a.json", "--json").json()
    assert {row["qubit"] for row in found["circuits"]} == {0, 1}
    assert found["left_out"] == [
        {"qubit": qubit, "reason": "was not calibrated"} for qubit in (2, 3, 4)
    ]
    assert qcompile("export", "tiny.json", "--backend", "a.json", "--out", "job").code == 0
