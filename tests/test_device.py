"""Device files: reading, refusing invalid ones, and the paper's table they come from."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from qcompile.device import IDEAL, Device, device_names, load_device
from qcompile.errors import DeviceError
from qcompile.noise import unusable, usable

FAKES = (
    "fake_lagos",
    "fake_belem",
    "fake_lima",
    "fake_jakarta",
    "fake_toronto",
    "fake_fez",
    "fake_kingston",
)

# arXiv 2203.14348, device table: qubits, T1 us, T2 us, assignment error, readout ns, sx error.
PAPER = {
    "ibm_lagos": (7, 75.65, 39.3, 1.16e-2, 704, 3.11e-4),
    "ibm_belem": (5, 86.5, 100.93, 2.46e-2, 5351.111, 2.33e-4),
    "ibm_lima": (5, 87.9, 87.83, 2.49e-2, 5351.111, 5.31e-4),
    "ibm_jakarta": (7, 91.96, 41.46, 3.41e-2, 5351.111, 3.84e-4),
    "ibm_toronto": (27, 92.3, 55.67, 4.57e-2, 5201.778, 2.34e-4),
}


@pytest.mark.parametrize("name", PAPER)
def test_the_paper_s_devices_hold_its_table(name: str) -> None:
    qubits, t1_us, t2_us, readout_error, readout_ns, gate_error = PAPER[name]
    device = load_device(name)
    assert device.name == name
    assert "2203.14348" in device.source
    assert device.basis_gates == ("rz", "sx", "x")
    assert len(device.qubits) == qubits
    for qubit in device.qubits:
        assert (qubit.t1_us, qubit.t2_us, qubit.readout_ns) == (t1_us, t2_us, readout_ns)
        assert qubit.p10 == qubit.p01 == readout_error
        assert set(qubit.gates) == {"sx", "x"}
        for gate in qubit.gates.values():
            assert (gate.error, gate.length_ns) == (gate_error, 35.56)


def test_the_paper_s_gate_errors_below_relaxation_are_flagged() -> None:
    # (t/T1 + 2 t/T2) / 6 with t = 35.56 ns: 3.8e-4 on lagos and 2.8e-4 on toronto.
    flagged = {name for name in PAPER if load_device(name).qubits[0].doubtful}
    assert flagged == {"ibm_lagos", "ibm_toronto"}


@pytest.mark.parametrize("name", PAPER)
def test_ibmq_names_are_aliases(name: str) -> None:
    assert load_device(name.replace("ibm_", "ibmq_")) == load_device(name)


def test_every_shipped_file_is_read_and_its_name_is_the_file_s() -> None:
    names = device_names()
    assert names[0] == "ideal"
    assert {*PAPER, *FAKES} <= set(names)
    for name in [*PAPER, *FAKES]:
        device = load_device(name)
        assert device.name == name
        assert Device.model_validate_json(device.to_json()) == device


def test_ideal_has_no_qubits_of_its_own() -> None:
    assert load_device("ideal") is IDEAL
    assert IDEAL.is_ideal


def test_a_machine_is_distinguished_from_its_snapshot() -> None:
    with pytest.raises(DeviceError, match=r"IBM machine.*\n.*Use fake_fez, IBM's snapshot"):
        load_device("ibm_fez")


def test_a_path_is_read(tmp_path) -> None:
    path = tmp_path / "mine.json"
    path.write_text(load_device("ibm_lima").model_copy(update={"name": "mine"}).to_json())
    assert load_device(str(path)).name == "mine"


def test_hardware_in_the_working_folder_is_found_by_name(tmp_path, monkeypatch) -> None:
    (tmp_path / "hardware").mkdir()
    device = load_device("ibm_lima").model_copy(update={"name": "mine", "aliases": ("our_own",)})
    (tmp_path / "hardware" / "mine.json").write_text(device.to_json())
    monkeypatch.chdir(tmp_path)
    assert load_device("mine") == load_device("our_own") == device
    assert "mine" in device_names()


@pytest.mark.parametrize(
    ("wrong", "near"), [("ibm_lama", "ibm_lima"), ("fake_jacarta", "fake_jakarta")]
)
def test_an_unknown_name_brings_the_nearest(wrong: str, near: str) -> None:
    with pytest.raises(DeviceError, match=f"Unknown backend '{wrong}'") as caught:
        load_device(wrong)
    assert near in str(caught.value)


def _valid() -> dict:
    return json.loads(load_device("fake_lima").to_json())


def _without(key: str):
    def change(device: dict) -> None:
        del device["qubits"][1][key]

    return change


def _with(key: str, value: object):
    def change(device: dict) -> None:
        device["qubits"][1][key] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_with("p10", 1.2), ["qubits.1.p10", "1.2"]),
        (_with("p01", -0.1), ["qubits.1.p01"]),
        (_with("p10", float("nan")), ["qubits.1.p10"]),
        (_with("t1_us", float("nan")), ["qubits.1.t1_us"]),
        (_with("t1_us", float("inf")), ["qubits.1.t1_us"]),
        (_with("t2_us", 0), ["qubits.1.t2_us"]),
        (_with("t2_us", "long"), ["qubits.1.t2_us", "long"]),
        (_with("readout_ns", -1), ["qubits.1.readout_ns"]),
        (_with("gates", {"sx": {"error": 0.1}}), ["qubits.1.gates.sx.length_ns"]),
        (_with("gates", {"sx": {"error": 2, "length_ns": 1}}), ["qubits.1.gates.sx.error"]),
        (_with("t3_us", 1.0), ["qubits.1.t3_us"]),
        (_without("t1_us"), ["qubits.1.t1_us"]),
        (_without("p01"), ["qubits.1.p01"]),
        (lambda d: d.update(colour="red"), ["colour"]),
        (lambda d: d.pop("source"), ["source"]),
        (lambda d: d.pop("name"), ["name"]),
        (lambda d: d.update(name="a b"), ["name"]),
        (lambda d: d.update(format="qcompile-device-9"), ["format"]),
        (lambda d: d.update(qubits=[]), ["only the device 'ideal'", "has no qubits"]),
        (lambda d: d.update(basis_gates=["u1", "u2"]), ["basis_gates", "rz, sx, x"]),
        (lambda d: d.update(basis_gates=["rz", "sx"]), ["basis_gates"]),
    ],
)
def test_the_error_of_an_invalid_file_names_the_fault(tmp_path, change, words: list[str]) -> None:
    contents = _valid()
    change(contents)
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(contents))
    with pytest.raises(DeviceError) as caught:
        load_device(str(path))
    for word in [str(path), *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"name": }', "\x00\xff"])
def test_other_json_is_refused(tmp_path, text: str) -> None:
    path = tmp_path / "wrong.json"
    path.write_text(text)
    with pytest.raises(DeviceError, match="is not a device file"):
        load_device(str(path))


def test_a_device_cannot_be_changed() -> None:
    device = load_device("ibm_lima")
    with pytest.raises(ValueError, match="frozen"):
        device.name = "other"


def test_usable_qubits_are_the_well_read_ones_best_first() -> None:
    assert usable(load_device("fake_lagos")) == (3, 4)
    lima = load_device("fake_lima")
    contrast = [lima.qubits[q].contrast for q in usable(lima)]
    assert sorted(usable(lima)) == [0, 1, 2, 3, 4]
    assert np.all(np.diff(contrast) <= 0)


def test_one_qubit_is_left_where_all_are_bad() -> None:
    lagos = load_device("fake_lagos")
    bad = lagos.model_copy(update={"qubits": lagos.qubits[:3]})
    assert usable(bad) == (1,)
    assert [*unusable(bad)] == [0, 2]


def test_qubits_can_be_left_out(tmp_path) -> None:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(_valid() | {"left_out": [2, 0]}))
    device = load_device(path)
    assert device.left_out == (2, 0)
    assert usable(device) == (1, 3, 4)
    assert unusable(device) == {0: "is in left_out", 2: "is in left_out"}
    assert Device.model_validate_json(device.to_json()) == device


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_with("p10", "0.1"), ["qubits.1.p10", "valid number"]),
        (_with("p01", True), ["qubits.1.p01", "valid number"]),
        (_with("t1_us", "100"), ["qubits.1.t1_us", "valid number"]),
        (_with("gates", {"sx": {"error": "0.1", "length_ns": 1}}), ["qubits.1.gates.sx.error"]),
        (_with("gates", {"sx": {"error": 0, "length_ns": True}}), ["qubits.1.gates.sx.length_ns"]),
        (lambda d: d.update(left_out=[1, 5]), ["left_out names qubit 5", "does not have"]),
        (lambda d: d.update(left_out=[-1]), ["left_out names qubit -1"]),
        (lambda d: d.update(left_out=[0, 1, 2, 3, 4]), ["left_out names every qubit"]),
        (lambda d: d.update(left_out=[True]), ["left_out.0", "valid integer"]),
        (lambda d: d.update(source=3), ["source", "valid string"]),
        (lambda d: d.update(basis_gates="rz sx x"), ["basis_gates"]),
    ],
)
def test_types_are_strict(tmp_path, change, words: list[str]) -> None:
    test_the_error_of_an_invalid_file_names_the_fault(tmp_path, change, words)


@pytest.mark.parametrize("text", ["two\nlines", "\x1b[2Jgone", "\x9b2J", "bell\x07", "\x7f", ""])
@pytest.mark.parametrize("key", ["source", "calibrated", "notes", "aliases", "doubtful"])
def test_texts_that_would_steer_a_terminal_are_refused(tmp_path, key: str, text: str) -> None:
    def change(device: dict) -> None:
        owner = device["qubits"][1] if key == "doubtful" else device
        owner[key] = text if key in ("source", "calibrated") else [text]

    test_the_error_of_an_invalid_file_names_the_fault(tmp_path, change, [key])


@pytest.mark.parametrize("name", ["[/x]", "\x1b[2J", "s x", "", "sx\n", "s" * 41])
def test_gate_names_are_words(tmp_path, name: str) -> None:
    """A gate name heads a column of a table, where [/x] would be markup."""
    gate = {"error": 0.1, "length_ns": 1}
    change = _with("gates", {name: gate})
    test_the_error_of_an_invalid_file_names_the_fault(tmp_path, change, ["qubits.1.gates"])

    def also(device: dict) -> None:
        device["basis_gates"].append(name)

    test_the_error_of_an_invalid_file_names_the_fault(tmp_path, also, ["basis_gates"])


@pytest.mark.parametrize("key", ["\x1b[2J", "two\nlines", "\x9b"])
def test_a_message_about_a_key_does_not_steer_a_terminal(tmp_path, key: str) -> None:
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(_valid() | {key: 1}))
    with pytest.raises(DeviceError) as caught:
        load_device(path)
    head, *lines = str(caught.value).split("\n")
    assert head == f"{path} is not a device file."
    assert len(lines) == 1
    assert lines[0].isprintable()


@pytest.mark.parametrize(
    ("positions", "found", "words"),
    [
        ([[0, 0]], "2", "there are 1 positions for 5 qubits"),
        ([[0, 0]] * 5, "1", "positions need the format qcompile-device-2"),
        ([[0, "a"]] * 5, "2", "positions.0.1"),
    ],
)
def test_positions_are_one_for_each_qubit(tmp_path, positions, found: str, words: str) -> None:
    values = {"format": f"qcompile-device-{found}", "couplings": [], "positions": positions}
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(_valid() | values))
    with pytest.raises(DeviceError, match=re.escape(words)):
        load_device(path)


@pytest.mark.parametrize("qubits", [True, False])
def test_the_ideal_device_is_not_read_from_a_file(tmp_path, qubits: bool) -> None:
    contents = _valid() | {"name": "ideal"}
    if not qubits:
        contents |= {"qubits": [], "couplings": []}
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(contents))
    with pytest.raises(DeviceError, match=r"'ideal'.* is built in"):
        load_device(path)


def test_a_foreign_file_in_hardware_is_no_device(tmp_path, monkeypatch) -> None:
    (tmp_path / "hardware").mkdir()
    (tmp_path / "hardware" / "tsconfig.json").write_text("{}")
    before = device_names()
    monkeypatch.chdir(tmp_path)
    assert device_names() == before
    assert load_device("ibmq_lima").name == "ibm_lima"  # an alias: the search reads every device


@pytest.mark.parametrize("name", ["", "a b", "../x", "n" * 101])
def test_a_name_can_be_part_of_a_files_name(tmp_path, name: str) -> None:
    def change(device: dict) -> None:
        device["name"] = name

    test_the_error_of_an_invalid_file_names_the_fault(tmp_path, change, ["name"])
