"""`qcompile backends`: the list, one device, and a snapshot more."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Call = Callable[..., Any]


def test_devices_are_listed(qcompile: Call) -> None:
    answer = qcompile("backends")
    assert (answer.code, answer.err) == (0, "")
    assert "ibm_lima" in answer.out
    names = [device["name"] for device in qcompile("backends", "--json").json()]
    assert names[0] == "ideal"
    assert {"ibm_lima", "fake_toronto"} <= set(names)


def test_a_device_is_shown(qcompile: Call) -> None:
    answer = qcompile("backends", "show", "ibmq_lima")
    assert (answer.code, answer.err) == (0, "")
    assert "0.0249" in answer.out
    found = qcompile("backends", "show", "ibmq_lima", "--json").json()
    assert (found["name"], len(found["qubits"])) == ("ibm_lima", 5)


def test_couplings_are_listed(qcompile: Call) -> None:
    """Both directions in one row where they are alike; errors and lengths are the file's."""
    lima = qcompile("backends", "show", "fake_lima").out.splitlines()
    rows = [line.split() for line in lima if " cx " in line]
    found = qcompile("backends", "show", "fake_lima", "--json").json()["couplings"]
    assert [row[:3] for row in rows][:2] == [["0,", "1", "cx"], ["1,", "0", "cx"]]
    assert len(rows) == len(found) == 8
    assert [float(row[3]) for row in rows[:2]] == pytest.approx([found[0]["error"]] * 2, rel=1e-3)
    assert [float(row[4]) for row in rows[:2]] == pytest.approx([305.8, 341.3])
    fez = qcompile("backends", "show", "fake_fez").out
    assert fez.count(" both ways ") == 169
    listed = qcompile("backends").out.splitlines()
    assert "9.1e-03 cx" in next(line for line in listed if "fake_lima" in line)
    assert " cx" not in next(line for line in listed if "ibm_lima" in line)


@pytest.mark.parametrize("contents", ["{}", "[1, 2]", "no JSON", '{"format": "another"}'])
def test_files_of_others_in_hardware_are_ignored(qcompile: Call, contents: str) -> None:
    before = qcompile("backends", "--json").out
    Path("hardware").mkdir()
    Path("hardware/package.json").write_text(contents)
    answer = qcompile("backends", "--json")
    assert (answer.code, answer.out, answer.err) == (0, before, "")
    assert "package" not in qcompile("backends").out
    asked = qcompile("backends", "show", "package")
    assert (asked.code, asked.out) == (1, "")
    assert asked.err.startswith("Error: hardware/package.json is not a device file.\n")


def test_a_file_cannot_take_the_place_of_the_ideal_backend(qcompile: Call) -> None:
    before = qcompile("backends", "--json").out
    device = qcompile("backends", "show", "ibm_lima", "--json").out
    Path("hardware").mkdir()
    Path("hardware/ideal.json").write_text(device)
    assert qcompile("backends", "--json").out == before
    assert qcompile("backends", "show", "ideal", "--json").json()["qubits"] == []


def test_folders_are_no_devices(qcompile: Call) -> None:
    Path("hardware/mine.json").mkdir(parents=True)
    assert qcompile("backends").code == 0


def test_a_snapshot_is_known_by_its_name(qcompile: Call, left: Call) -> None:
    pytest.importorskip("qiskit_ibm_runtime")
    answer = qcompile("backends", "add", "FakeLimaV2", "--name", "mine")
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith("mine, 5 qubits, written to hardware/mine.json\n")
    assert left() == ["hardware", "hardware/mine.json"]
    assert qcompile("backends", "show", "mine", "--json").json()["name"] == "mine"
    again = qcompile("backends", "add", "FakeLimaV2", "--name", "mine")
    assert (again.code, again.out) == (1, "")
    assert (
        again.err
        == """\
Error: hardware/mine.json already exists.
  Choose another with --out or --name.
"""
    )


@pytest.mark.parametrize("spelling", ["fake_lima", "qiskit:FakeLimaV2", "qiskit:fake_lima"])
def test_a_snapshot_is_spelled_as_backends_are(qcompile: Call, left: Call, spelling: str) -> None:
    pytest.importorskip("qiskit_ibm_runtime")
    assert qcompile("backends", "add", spelling, "--out", "a.json").code == 0
    assert left() == ["a.json"]


def test_a_snapshot_of_an_unknown_backend(qcompile: Call, left: Call) -> None:
    pytest.importorskip("qiskit_ibm_runtime")
    answer = qcompile("backends", "add", "FakeLimma")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: Unknown fake backend 'FakeLimma'.\n  Did you mean FakeLi")
    assert left() == []


def test_a_snapshot_cannot_take_the_name_of_the_ideal_backend(qcompile: Call, left: Call) -> None:
    answer = qcompile("backends", "add", "FakeLimaV2", "--name", "ideal")
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.endswith("'--name': 'ideal' is the name of the noiseless backend.\n")
    assert left() == []


def test_a_snapshot_without_qiskit_names_the_extra(
    qcompile: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "qiskit_ibm_runtime", None)
    answer = qcompile("backends", "add", "FakeLimaV2")
    assert (answer.code, answer.out) == (1, "")
    assert (
        answer.err
        == """\
Error: A snapshot of a Qiskit backend needs packages that are not installed.
  Install them with: pip install 'qcompile[qiskit]'
"""
    )


def test_a_backend_of_qiskit_is_shown(qcompile: Call) -> None:
    pytest.importorskip("qiskit_ibm_runtime")
    answer = qcompile("backends", "show", "qiskit:FakeLimaV2", "--json")
    assert answer.code == 0
    assert len(answer.json()["qubits"]) == 5
    answer = qcompile("backends", "show", "qiskit:FakeLimma")
    assert (answer.code, answer.out) == (1, "")
    assert answer.err.startswith("Error: Unknown fake backend 'FakeLimma'.\n")
