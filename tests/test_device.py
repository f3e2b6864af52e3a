"""Device files: what is read, what is refused, and the snapshots and the table they come from."""

from __future__ import annotations

import json
from datetime import UTC, datetime

import numpy as np
import pytest

from qcompile.device import IDEAL, Device, device_names, load_device
from qcompile.errors import DeviceError, MissingExtraError
from qcompile.snapshot import device_from_backend, find_backend

FAKES = ("fake_lagos", "fake_belem", "fake_lima", "fake_jakarta", "fake_toronto")

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


@pytest.fixture(scope="module")
def lima():
    return find_backend("FakeLimaV2")


@pytest.mark.parametrize("name", FAKES)
def test_the_fakes_are_what_the_snapshot_gives_today(name: str) -> None:
    shipped, fresh = load_device(name), device_from_backend(find_backend(name), name)
    # The source names the version of qiskit-ibm-runtime, which may be another one today.
    assert fresh.model_copy(update={"source": shipped.source}) == shipped
    assert shipped.source.startswith("qiskit-ibm-runtime 0.51.0, Fake")


def test_a_snapshot_holds_the_backend_s_own_numbers(lima) -> None:
    properties = lima.properties()
    for index, qubit in enumerate(load_device("fake_lima").qubits):
        values = properties.qubit_property(index)
        assert qubit.t1_us == pytest.approx(1e6 * properties.t1(index), rel=1e-15)
        assert qubit.t2_us == pytest.approx(1e6 * properties.t2(index), rel=1e-15)
        assert qubit.p10 == values["prob_meas1_prep0"][0]
        assert qubit.p01 == values["prob_meas0_prep1"][0]
        assert qubit.readout_ns == pytest.approx(1e9 * properties.readout_length(index), rel=1e-15)
        assert set(qubit.gates) == {"sx", "x"}
        for name, gate in qubit.gates.items():
            assert gate.error == properties.gate_error(name, index)
            length = properties.gate_length(name, index)
            assert gate.length_ns == pytest.approx(1e9 * length, rel=1e-15)
    assert load_device("fake_lima").calibrated == properties.last_update_date.isoformat()


def test_doubtful_data_is_flagged() -> None:
    toronto, lagos = load_device("fake_toronto"), load_device("fake_lagos")
    assert all("sx length 568.9 ns is above 200 ns" in q.doubtful for q in toronto.qubits)
    assert "16 times" in toronto.notes[0]
    unreadable = [i for i, q in enumerate(lagos.qubits) if any("readout" in d for d in q.doubtful)]
    assert unreadable == [0, 1, 2, 5, 6]
    assert lagos.notes == ("5 of 7 qubits have a readout error above 0.1: 0, 1, 2, 5, 6.",)
    # Lima's qubit 0: (3 - exp(-t/T1) - 2 exp(-t/T2)) / 6 with t = 35.6 ns is 2.26e-4.
    assert load_device("fake_lima").qubits[0].doubtful == tuple(
        f"{gate} error 0.000192 is below the 0.000226 of relaxation alone" for gate in ("sx", "x")
    )
    assert load_device("fake_lima").qubits[1].doubtful == ()


def test_t2_above_its_limit_is_flagged(lima) -> None:
    properties = lima.properties()
    next(v for v in properties.qubits[2] if v.name == "T2").value = 300.0
    device = device_from_backend(_With(lima, properties), "long_t2")
    assert "T2 300 us is above 2 T1 = 207.6 us" in device.qubits[2].doubtful


class _With:
    """A backend with other properties."""

    def __init__(self, backend, properties):
        self.name, self.operation_names = backend.name, backend.operation_names
        self.target = backend.target
        self.properties = lambda: properties


@pytest.mark.parametrize("missing", ["T1", "T2", "prob_meas0_prep1", "prob_meas1_prep0"])
def test_a_qubit_that_lacks_a_property_is_left_out(lima, missing: str) -> None:
    properties = lima.properties()
    properties.qubits[3] = [v for v in properties.qubits[3] if v.name != missing]
    device = device_from_backend(_With(lima, properties), "broken")
    assert device.left_out == (3,)
    assert device.qubits[3].doubtful == (f"Qubit 3 has no {missing} in its calibration.",)
    assert device.notes[-1] == "Left out, faulty or without all values: 3."
    assert sorted(device.usable) == [0, 1, 2, 4]


def test_a_qubit_that_lacks_a_gate_is_left_out(lima) -> None:
    properties = lima.properties()
    properties.gates = [g for g in properties.gates if (g.gate, g.qubits) != ("sx", [4])]
    device = device_from_backend(_With(lima, properties), "broken")
    assert device.left_out == (4,)
    assert "no gate_error of sx" in device.qubits[4].doubtful[0]


def test_a_faulty_qubit_is_left_out(lima) -> None:
    properties = lima.properties()
    properties._qubits[2]["operational"] = (0, datetime.now(UTC))
    device = device_from_backend(_With(lima, properties), "faulty")
    assert (device.left_out, device.qubits[2].t1_us) == (
        (2,),
        load_device("fake_lima").qubits[2].t1_us,
    )


def test_a_device_without_a_whole_qubit_is_refused(lima) -> None:
    properties = lima.properties()
    properties.qubits = [[v for v in qubit if v.name != "T1"] for qubit in properties.qubits]
    with pytest.raises(DeviceError, match=r"no qubit with all its values\. Qubit 0 has no T1"):
        device_from_backend(_With(lima, properties), "broken")


def test_a_machine_of_today_with_a_qubit_it_does_not_know() -> None:
    """Of ibm_kingston's 156 qubits, as IBM published them, number 146 has no T1."""
    kingston = find_backend("FakeKingston")
    device = device_from_backend(kingston, "kingston")
    assert (len(device.qubits), 146 in device.left_out) == (156, True)


def test_units_are_converted_and_unknown_ones_refused(lima) -> None:
    properties = lima.properties()
    t1 = next(v for v in properties.qubits[0] if v.name == "T1")
    t1.value, t1.unit = 0.05, "ms"
    assert device_from_backend(_With(lima, properties), "ms").qubits[0].t1_us == 50.0
    t1.unit = "fortnight"
    with pytest.raises(DeviceError, match="Qubit 0: T1 has the unit 'fortnight'"):
        device_from_backend(_With(lima, properties), "broken")


def test_an_impossible_value_is_named_with_its_qubit(lima) -> None:
    properties = lima.properties()
    next(v for v in properties.qubits[1] if v.name == "prob_meas1_prep0").value = 1.5
    device = device_from_backend(_With(lima, properties), "broken")
    assert device.left_out == (1,)
    assert device.qubits[1].doubtful[0].startswith("Qubit 1 has an impossible value: p10: ")


def test_without_properties_the_target_is_read(lima) -> None:
    device = device_from_backend(_With(lima, None), "from_target")
    assert any("symmetric" in note for note in device.notes)
    shipped = load_device("fake_lima")
    assert device.calibrated is None
    for ours, theirs in zip(device.qubits, shipped.qubits, strict=True):
        assert ours.t1_us == pytest.approx(theirs.t1_us, rel=1e-12)
        assert ours.t2_us == pytest.approx(theirs.t2_us, rel=1e-12)
        assert ours.p10 == ours.p01 == pytest.approx((theirs.p10 + theirs.p01) / 2, rel=1e-12)
        assert ours.gates["sx"].error == theirs.gates["sx"].error
        assert ours.gates["sx"].length_ns == pytest.approx(theirs.gates["sx"].length_ns, rel=1e-12)


def test_a_backend_with_fractional_rx_keeps_it() -> None:
    device = device_from_backend(find_backend("fake_fractional"), "fractional")
    assert "rx" in device.basis_gates
    assert all({"sx", "x", "rx"} <= set(q.gates) for q in device.qubits)


def test_a_backend_with_other_gates_is_refused() -> None:
    with pytest.raises(DeviceError, match=r"u1, u2, u3.*\n.*needs rz, sx and x"):
        device_from_backend(find_backend("FakeEssexV2"), "essex")


def test_backends_are_found_by_class_and_by_name() -> None:
    assert type(find_backend("FakeLimaV2")) is type(find_backend("fake_lima"))
    with pytest.raises(DeviceError, match="Did you mean fake_lima"):
        find_backend("fake_limo")


def test_a_missing_package_comes_with_the_line_that_installs_it(monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "qiskit_ibm_runtime", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'qcompile\[qiskit\]'"):
        find_backend("FakeLimaV2")


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
def test_a_wrong_file_names_what_is_wrong(tmp_path, change, words: list[str]) -> None:
    contents = _valid()
    change(contents)
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(contents))
    with pytest.raises(DeviceError) as caught:
        load_device(str(path))
    for word in [str(path), *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"name": }', "\x00\xff"])
def test_what_is_no_json_object_is_refused(tmp_path, text: str) -> None:
    path = tmp_path / "wrong.json"
    path.write_text(text)
    with pytest.raises(DeviceError, match="is no device file"):
        load_device(str(path))


def test_a_device_cannot_be_changed() -> None:
    device = load_device("ibm_lima")
    with pytest.raises(ValueError, match="frozen"):
        device.name = "other"


def test_usable_qubits_are_the_well_read_ones_best_first() -> None:
    assert load_device("fake_lagos").usable == (3, 4)
    lima = load_device("fake_lima")
    contrast = [lima.qubits[q].contrast for q in lima.usable]
    assert sorted(lima.usable) == [0, 1, 2, 3, 4]
    assert np.all(np.diff(contrast) <= 0)


def test_one_qubit_is_left_where_all_are_bad() -> None:
    lagos = load_device("fake_lagos")
    bad = lagos.model_copy(update={"qubits": lagos.qubits[:3]})
    assert bad.usable == (1,)
    assert [*bad.unusable] == [0, 2]


def test_qubits_can_be_left_out(tmp_path) -> None:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(_valid() | {"left_out": [2, 0]}))
    device = load_device(path)
    assert device.left_out == (2, 0)
    assert device.usable == (1, 3, 4)
    assert device.unusable == {0: "is in left_out", 2: "is in left_out"}
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
def test_numbers_and_texts_are_what_they_look_like(tmp_path, change, words: list[str]) -> None:
    test_a_wrong_file_names_what_is_wrong(tmp_path, change, words)


@pytest.mark.parametrize("text", ["two\nlines", "\x1b[2Jgone", "\x9b2J", "bell\x07", "\x7f", ""])
@pytest.mark.parametrize("key", ["source", "calibrated", "notes", "aliases", "doubtful"])
def test_texts_that_would_steer_a_terminal_are_refused(tmp_path, key: str, text: str) -> None:
    def change(device: dict) -> None:
        owner = device["qubits"][1] if key == "doubtful" else device
        owner[key] = text if key in ("source", "calibrated") else [text]

    test_a_wrong_file_names_what_is_wrong(tmp_path, change, [key])


@pytest.mark.parametrize("name", ["[/x]", "\x1b[2J", "s x", "", "sx\n", "s" * 41])
def test_gate_names_are_words(tmp_path, name: str) -> None:
    """A gate name heads a column of a table, where [/x] would be markup."""
    gate = {"error": 0.1, "length_ns": 1}
    change = _with("gates", {name: gate})
    test_a_wrong_file_names_what_is_wrong(tmp_path, change, ["qubits.1.gates"])

    def also(device: dict) -> None:
        device["basis_gates"].append(name)

    test_a_wrong_file_names_what_is_wrong(tmp_path, also, ["basis_gates"])


@pytest.mark.parametrize("key", ["\x1b[2J", "two\nlines", "\x9b"])
def test_a_message_about_a_key_does_not_steer_a_terminal(tmp_path, key: str) -> None:
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(_valid() | {key: 1}))
    with pytest.raises(DeviceError) as caught:
        load_device(path)
    head, *lines = str(caught.value).split("\n")
    assert head == f"{path} is no device file."
    assert len(lines) == 1
    assert lines[0].isprintable()


@pytest.mark.parametrize("qubits", [True, False])
def test_the_ideal_device_is_not_read_from_a_file(tmp_path, qubits: bool) -> None:
    contents = _valid() | {"name": "ideal"}
    if not qubits:
        contents["qubits"] = []
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

    test_a_wrong_file_names_what_is_wrong(tmp_path, change, ["name"])
