"""`qcompile evaluate` on twins and samplers, and with calibrations that were measured before."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]

FEW = ("--shots", 16, "--episodes", 2, "--workers", 1, "--out", "e")


def comparable(values: dict[str, Any], *left_out: str) -> dict[str, Any]:
    return {k: v for k, v in values.items() if k not in ("wall_seconds", *left_out)}


def test_a_twin_beside_its_device(qcompile: Call, policy: Call, calibration: str) -> None:
    name = policy()
    backends = ("--backend", f"fake_lima,./{calibration}")
    answer = qcompile("evaluate", name, *backends, *FEW, "--json")
    assert (answer.code, answer.err) == (0, "")
    columns = ("backend", "device", "kind", "mitigation", "calibration")
    objects = answer.json()["results"]
    assert [tuple(o[key] for key in columns) for o in objects[1:]] == [
        ("fake_lima", "fake_lima", "noise-model", "none", None),
        ("fake_lima", "fake_lima", "noise-model", "readout", None),
        ("lima.json", "fake_lima", "measured-response", "none", None),
        ("lima.json", "fake_lima", "measured-response", "readout", None),
    ]
    rows = list(csv.DictReader(Path("e/results.csv").read_text().splitlines()))
    assert [row["backend"] for row in rows[1:]] == ["fake_lima"] * 2 + ["lima.json"] * 2
    cells = sorted(path.name for path in Path("e/cells").iterdir())
    assert cells[3] == "tiny-lima.json-16-none-level2-episodes2-seed0.json"
    for cell in objects[3:]:
        settings = ("--mitigation", cell["mitigation"], "--shots", 16, "--episodes", 2)
        run = qcompile("run", name, "--backend", calibration, *settings, "--json").json()
        assert comparable(run, "backend").items() <= cell.items()
        assert run["backend"] == cell["device"]
    table = qcompile("evaluate", name, *backends, *FEW)
    assert "0 cells played, 5 loaded" in table.out
    assert table.out.count(" lima.json ") == 2


def test_misfits_of_a_calibration_are_told(qcompile: Call, policy: Call, calibration: str) -> None:
    values = json.loads(Path(calibration).read_text())
    values["response"]["chi_square"] = [500.0] * 5
    Path(calibration).write_text(json.dumps(values))
    words = ("evaluate", policy(), "--backend", calibration, *FEW, "--mitigation", "readout")
    ideal, twin = qcompile(*words, "--json").json()["results"]
    assert ideal["calibration_misfits"] == []
    assert len(twin["calibration_misfits"]) == 4
    text = " ".join(qcompile(*words).out.split())
    assert "lima.json: The response of qubit 0, " in text


def test_a_twin_is_played_again_when_it_was_measured_again(
    qcompile: Call, policy: Call, calibration: str
) -> None:
    words = ("evaluate", policy(), "--backend", calibration, *FEW)
    assert "3 cells played, 0 loaded" in qcompile(*words).out
    words_again = ("calibrate", "--backend", "fake_lima", "--out", calibration, "--force")
    assert qcompile(*words_again, "--seed", 2).code == 0
    assert "2 cells played, 1 loaded" in qcompile(*words).out


def test_a_given_calibration_is_not_measured_again(
    qcompile: Call, policy: Call, calibration: str
) -> None:
    name = policy()
    words = ("evaluate", name, "--backend", "fake_lima,ibm_lima", *FEW, "--json")
    plain = qcompile(*words).json()["results"]
    answer = qcompile(*words, "--calibration", calibration)
    assert (answer.code, answer.err) == (0, "")
    given = answer.json()["results"]
    files = [values["calibration"] for values in given]
    assert files == [None, None, "lima.json", None, None]
    assert given[2]["executions"] == 16 * given[2]["env_steps"]
    measured = 6 * 8192  # 4 qubits: 2 + 2 log2(4) patterns
    assert plain[2]["executions"] == 16 * plain[2]["env_steps"] + measured
    settings = ("--mitigation", "readout", "--shots", 16, "--episodes", 2, "--json")
    file = ("--calibration", calibration)
    run = qcompile("run", name, "--backend", "fake_lima", *settings, *file).json()
    assert comparable(run).items() <= given[2].items()
    unchanged = [comparable(values) for index, values in enumerate(plain) if index != 2]
    assert unchanged == [comparable(v) for index, v in enumerate(given) if index != 2]
    assert "0 cells played, 5 loaded" in qcompile(*words[:-1]).out, "both kinds are kept"


def test_a_sampler_has_shots_alone(qcompile: Call, policy: Call) -> None:
    name = policy()
    few = ("--backend", "qiskit:fake_lima", "--mitigation", "none", *FEW)
    answer = qcompile("evaluate", name, *few, "--shots", "exact", "--json")
    assert answer.code == 0
    why = "shots exact on qiskit:FakeLimaV2: it runs through a sampler, which needs shots.\n"
    assert answer.err == f"Left out: {why}"
    (_, cell) = answer.json()["results"]
    assert (cell["backend"], cell["device"]) == ("qiskit:FakeLimaV2", "fake_lima")
    settings = ("--mitigation", "none", "--shots", 16, "--episodes", 2, "--json")
    run = qcompile("run", name, "--backend", "qiskit:FakeLimaV2", *settings).json()
    assert comparable(run, "backend").items() <= cell.items()
    words = ("evaluate", name, "--backend", "qiskit:FakeLimaV2", "--shots", "exact")
    refused = qcompile(*words, "--mitigation", "none", "--out", "f")
    assert (refused.code, refused.out) == (1, "")
    assert refused.err.startswith(f"Error: There is no combination to play.\n  Left out: {why}")


def test_an_old_calibration_is_reported(qcompile: Call, policy: Call, calibration: str) -> None:
    values = json.loads(Path(calibration).read_text())
    Path("old.json").write_text(json.dumps(values | {"created": "2020-01-01T00:00:00Z"}))
    words = ("evaluate", policy(), "--backend", "fake_lima", *FEW, "--calibration", "old.json")
    answer = qcompile(*words)
    assert answer.code == 0
    assert answer.err.startswith("old.json is ")
    assert " hours old; check it with `qcompile calibrate " in answer.err


REFUSED = {
    "of no backend": (
        ("--backend", "ibm_lima", "--calibration", "lima.json"),
        "lima.json is of fake_lima, which is not in this grid.\n"
        "  Devices of this grid: ibm_lima.\n"
        "  Remove it, or add --backend fake_lima.\n",
    ),
    "not needed": (
        ("--mitigation", "none", "--calibration", "lima.json"),
        "lima.json is not needed: nothing on fake_lima is mitigated.\n"
        "  Remove it, or add --mitigation readout or response.\n",
    ),
    "two of one device": (
        ("--calibration", "lima.json,two.json"),
        "lima.json and two.json are both of fake_lima.\n"
        "  A grid takes one calibration per device: evaluate them one after the other.\n",
    ),
    "a part": (
        ("--mitigation", "readout,response", "--calibration", "part.json"),
        "part.json cannot mitigate tiny on fake_lima (response):\n"
        "  The calibration has no response curves.\n",
    ),
    "a qubit": (
        ("--calibration", "two.json"),
        "two.json cannot mitigate tiny on fake_lima (readout):\n"
        "  Qubit 2 has no calibration.\n"
        "  Calibrated on fake_lima: 0 1.\n",
    ),
    "no calibration": (("--calibration", "tiny.json"), "tiny.json is not a calibration.\n"),
    "no file": (("--calibration", "nosuch.json"), "There is no calibration file nosuch.json.\n"),
    "a twin without curves": (
        ("--backend", "part.json"),
        "The calibration of fake_lima has no response curves.\n",
    ),
    "no such fake backend": (
        ("--backend", "qiskit:FakeLimaV3"),
        "Unknown fake backend 'FakeLimaV3'.\n  Did you mean FakeLimaV2",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_does_not_fit_is_refused_before_any_episode(
    qcompile: Call,
    policy: Call,
    calibration: str,
    monkeypatch: pytest.MonkeyPatch,
    what: str,
) -> None:
    monkeypatch.setattr("qcompile.sweep.complete.run_all", pytest.fail)
    measure = ("calibrate", "--backend", "fake_lima", "--qubits")
    assert qcompile(*measure, "0,1", "--out", "two.json").code == 0
    assert qcompile(*measure, "0,1,2,3,4", "--parts", "readout", "--out", "part.json").code == 0
    words, text = REFUSED[what]
    backend = () if "--backend" in words else ("--backend", "fake_lima")
    answer = qcompile("evaluate", policy(), *backend, *words)
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith(f"Error: {text}")
    assert not Path("evaluation").exists()
