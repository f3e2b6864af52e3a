"""Snapshots: the device made from a Qiskit backend, what is flagged, and what is left out."""

from __future__ import annotations

from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from qcompile.device import load_device
from qcompile.errors import DeviceError, MissingExtraError
from qcompile.noise import usable
from qcompile.snapshot import device_from_backend, find_backend

FAKES = (
    "fake_lagos",
    "fake_belem",
    "fake_lima",
    "fake_jakarta",
    "fake_toronto",
    "fake_fez",
    "fake_kingston",
)


@pytest.fixture(scope="module")
def lima():
    return find_backend("FakeLimaV2")


@pytest.mark.parametrize("name", FAKES)
def test_the_shipped_fakes_match_new_snapshots(name: str) -> None:
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


def test_positions_are_where_ibm_draws_the_qubits() -> None:
    """Coupled qubits of a lattice are one step apart; older backends do not say."""
    for name in ("fake_lagos", "fake_fez", "fake_kingston"):
        device = load_device(name)
        coords = find_backend(name).configuration().coords
        assert [list(pair) for pair in device.positions] == coords
        for coupling in device.couplings:
            (a, b), (c, d) = (device.positions[qubit] for qubit in coupling.qubits)
            assert abs(a - c) + abs(b - d) == 1
    assert load_device("fake_lima").positions == ()


@pytest.mark.parametrize("coords", [None, [[1, 2]], [[1]] * 5, [None] * 5, "abcde", 5])
def test_positions_of_another_form_are_left_out(lima, coords: object) -> None:
    backend = _With(lima, lima.properties())
    backend.configuration = lambda: SimpleNamespace(coords=coords)
    assert device_from_backend(backend, "other").positions == ()


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
    assert device.notes[-1] == "Left out because they are faulty or lack values: 3."
    assert sorted(usable(device)) == [0, 1, 2, 4]


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
    with pytest.raises(DeviceError, match=r"has all its values\. Qubit 0 has no T1"):
        device_from_backend(_With(lima, properties), "broken")


def test_a_machine_of_today_with_a_qubit_it_does_not_know() -> None:
    """Of ibm_kingston's 156 qubits, as IBM published them, number 146 has no T1."""
    device = load_device("fake_kingston")
    assert (len(device.qubits), device.left_out) == (156, (146,))
    assert device.qubits[146].doubtful == ("Qubit 146 has no T1 in its calibration.",)
    # IBM gives the gates of these four an error of 1; their neighbours are as usual.
    assert [i for i, q in enumerate(device.qubits) if q.gates and q.gates["sx"].error == 1.0] == [
        96, 112, 113, 131,
    ]  # fmt: skip
    assert {96, 112, 113, 131, 146}.isdisjoint(usable(device))
    assert len(usable(device)) >= 6 * 24  # six copies of lunarlander's circuits


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
