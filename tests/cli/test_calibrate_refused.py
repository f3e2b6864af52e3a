"""`qcompile calibrate`: what is refused, and what an end before the end leaves."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qcompile.calibration import load_calibration

Call = Callable[..., Any]

LIMA = ("calibrate", "--backend", "fake_lima", "--seed", 1)


@pytest.mark.usefixtures("nothing_is_measured")
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--qubits", "0", "--policy", "x"), "--qubits and --policy cannot be combined"),
        (("--qubits", "0,x"), "'0,x' is not a list of qubits, such as 0,1,5."),
        (("--qubits", "-1"), "'-1' is not a list of qubits, such as 0,1,5."),
        (("--parts", "all"), "'all' is neither readout nor response."),
        (("--plot", "a.jpg"), "a.jpg must end with .png, .svg or .pdf."),
        (("--check", "a.json", "--shots", "exact"), "so --shots cannot be exact"),
        (("--shots", "0"), "0 is not in the range 1 to 10000000"),
        (("--max-age-hours", "0"), "0.0 is not in the range x>0"),
        (("--max-age-hours", "nan"), "'nan' is not a number of hours."),
        (("--max-age-hours", "2"), "--max-age-hours needs --check"),
        (("--check", "a.json", "--force"), "without it a check writes no file"),
        (
            ("--out", "a.png", "--plot", "x/../a.png"),
            "--out and --plot are the same file, x/../a.png.",
        ),
        (("--check", "a.png", "--plot", "a.png"), "--check and --plot are the same file, a.png."),
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
Error: fake_lima-calibration.json already exists.
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
        (("--check", "bad.json"), "bad.json is not a calibration.\n  It is not JSON: line 1"),
        (("--backend", "bad.json"), "bad.json is not a calibration.\n  It is not JSON: line 1"),
        (("--check", "nosuch.json"), "There is no calibration file nosuch.json.\n"),
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
    assert answer.err.startswith("Error: Some fits failed. The counts are in fake_")
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
    assert answer.err.startswith("Error: The calibration has no assignment matrices.\n  Too few")
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
    assert (answer.code, answer.err) == (1, "Error: Interrupted: a.png was not written.\n")
    assert answer.out.endswith("calibration written to a.json\n")
    assert left() == ["a.json"]
