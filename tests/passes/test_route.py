"""Routing: the same distribution on couplings that exist, and clear errors."""

from __future__ import annotations

import numpy as np
import pytest
from wide import ANY, operator, random_circuit

from qcompile.device import Device, load_device
from qcompile.errors import DeviceError
from qcompile.ir import Angle, Circuit, Gate
from qcompile.passes.route import Routed, route


def bound(circuit: Circuit) -> Circuit:
    values = {"x0": 0.3, "x1": -1.1, "theta0": 0.7, "theta1": 2.0}
    return circuit.substitute(values)


def distribution(circuit: Circuit, width: int) -> np.ndarray:
    """Of the first qubits of a circuit, from |0>."""
    state = np.abs(operator(circuit, {})[:, 0]) ** 2
    return state.reshape(-1, 2**width).sum(axis=0)  # Qiskit's first qubit is the lowest bit


@pytest.mark.parametrize("name", ["fake_lima", "fake_jakarta", "fake_fez"])
def test_a_routed_circuit_is_the_same_on_couplings_that_exist(name: str) -> None:
    device, rng = load_device(name), np.random.default_rng(1)
    for width in (2, 3, 4, 5):
        circuit = random_circuit(rng, ANY, width)
        routed = route(circuit, device)
        assert routed is not None
        assert len(set(routed.qubits.tolist())) == routed.circuit.width >= width
        used = {
            (gate.name, *(int(routed.qubits[q]) for q in gate.qubits))
            for gate in routed.circuit.gates
            if gate.is_coupling
        }
        assert used <= device.coupling_calibrations.keys()
        np.testing.assert_allclose(
            distribution(bound(routed.circuit), width),
            distribution(bound(circuit), width),
            atol=1e-10,
        )


def ring(width: int) -> Circuit:
    gates = [Gate("ry", Angle.symbol("x0"), (qubit,)) for qubit in range(width)]
    gates += [Gate("cz", None, (qubit, (qubit + 1) % width)) for qubit in range(width)]
    return Circuit(tuple(gates * 2), width)


def test_the_result_repeats_and_keeps_the_runs() -> None:
    device = load_device("fake_fez")
    first, again = route(ring(4), device), route(ring(4), device)
    assert isinstance(first, Routed)
    assert isinstance(again, Routed)
    assert first.circuit == again.circuit
    assert first.qubits.tolist() == again.qubits.tolist()
    assert first.circuit.symbols == ("x0",)


def test_a_line_gets_the_best_qubits_without_a_swap() -> None:
    """On fake_lima (0-1-2, 1-3-4) the coupling 3-4 has by far the largest error."""
    line = Circuit.parse("h@0 cx@0,1 h@1 cx@1,2", 3)
    routed = route(line, load_device("fake_lima"))
    assert routed is not None
    assert routed.circuit.width == 3
    assert sum(gate.is_coupling for gate in routed.circuit.gates) == 2
    assert 4 not in routed.qubits


def test_taken_qubits_are_left_alone() -> None:
    device = load_device("fake_lima")
    routed = route(ring(2), device, taken=(1,))
    assert routed is not None
    assert sorted(routed.qubits.tolist()) == [3, 4]
    assert route(ring(2), device, taken=(1, 3)) is None


def test_of_several_routings_the_best_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three rings of four on a map without squares: 12 couplings and swaps, five at best."""
    device, circuit = load_device("fake_fez"), Circuit(ring(4).gates[:8] * 3, 4)
    best = route(circuit, device)
    monkeypatch.setattr("qcompile.passes.route._TRIES", 1)
    one = route(circuit, device, seed=9)
    assert best is not None
    assert one is not None
    couplings = [sum(g.is_coupling for g in found.circuit.gates) for found in (best, one)]
    assert couplings == [12 + 5 * 3, 12 + 10 * 3]
    assert best.coupling_error(device) < 0.75 * one.coupling_error(device)
    with pytest.raises(ValueError, match="read-only"):
        best.qubits[0] = 0  # the next one who asks gets the same array


@pytest.mark.parametrize("left", [2, 4, 9, 13])
def test_few_free_qubits_of_a_large_machine(left: int) -> None:
    """Qiskit 2.6 panics where most qubits of a target have no gates: they are not part of it."""
    device = load_device("fake_toronto")
    free = [3, 6, 7, 10, 12, 14, 17, 18, 21, 16, 19, 20, 22][:left]
    routed = route(ring(4), device, taken=set(range(27)) - {*free})
    assert (routed is None) == (left < 9)  # 6, 7, 10, 12 are a line
    assert routed is None or {*routed.qubits.tolist()} <= {*free}


@pytest.mark.parametrize(
    ("name", "width", "message"),
    [
        ("ibm_lima", 2, "ibm_lima has no couplings.*2 qubits.\n.*fake_lima"),
        ("fake_lima", 6, "A circuit has 6 qubits, fake_lima has 5"),
    ],
)
def test_what_cannot_be_routed_is_refused(name: str, width: int, message: str) -> None:
    with pytest.raises(DeviceError, match=message):
        route(ring(width), load_device(name))


def test_a_coupling_that_is_missing_is_not_used() -> None:
    whole = load_device("fake_lima")
    kept = [each for each in whole.couplings if set(each.qubits) == {0, 1}]
    device = Device.model_validate(whole.model_dump() | {"couplings": kept})
    routed = route(ring(2), device)
    assert routed is not None
    assert sorted(routed.qubits.tolist()) == [0, 1]
    assert route(ring(3), device) is None


def test_a_circuit_on_named_qubits_stays_there_in_the_couplings_of_the_device() -> None:
    device = load_device("fake_fez")
    circuit = Circuit.parse("ry(x0)@0 cx@0,1 ry(x1)@1 ecr@1,2 cz@1,0 sx@2", 3)
    routed = route(circuit, device, on=(2, 1, 0), taken=(1,))
    assert routed is not None
    assert routed.qubits.tolist() == [2, 1, 0]
    names = {gate.name for gate in routed.circuit.gates if gate.is_coupling}
    assert names == {"cz"}
    np.testing.assert_allclose(
        distribution(bound(routed.circuit), 3), distribution(bound(circuit), 3), atol=1e-10
    )


def test_named_qubits_without_their_coupling_are_refused() -> None:
    with pytest.raises(DeviceError) as caught:
        route(ring(3), load_device("fake_jakarta"), on=(0, 1, 2))
    assert str(caught.value).splitlines() == [
        "fake_jakarta does not couple qubits 2 and 0, which cz connects.",
        "  It couples 0-1 1-2 1-3 3-5 4-5 5-6.",
        "  Name coupled qubits, or declare a register: its qubits are placed for you.",
    ]


def test_free_qubits_that_are_not_connected_are_tried_group_by_group() -> None:
    """A triangle fits on 3 of 4 coupled qubits with a swap; with 2 and 2 there is no way."""
    triangle = Circuit.parse("cx@0,1 h@1 cx@1,2 h@2 cx@2,0", 3)
    device = load_device("fake_toronto")
    every = set(range(len(device.qubits)))
    assert route(triangle, device, taken=every - {0, 1, 12, 10, 25, 26}) is None
    routed = route(triangle, device, taken=every - {0, 1, 12, 10, 7, 25, 26})
    assert routed is not None
    assert set(routed.qubits.tolist()) <= {12, 10, 7}
    np.testing.assert_allclose(
        distribution(routed.circuit, 3), distribution(triangle, 3), atol=1e-10
    )


def test_of_two_groups_the_one_with_the_least_error_is_taken() -> None:
    """Without its qubit 3 fake_jakarta falls into 0-1-2 and 4-5-6."""
    device = load_device("fake_jakarta")
    routed = route(Circuit.parse("h@0 cx@0,1 h@1", 2), device, taken=(3,))
    assert routed is not None
    readout = [(qubit.p10 + qubit.p01) / 2 for qubit in device.qubits]
    least = min(
        (each.error + sum(readout[qubit] for qubit in each.qubits), max(each.qubits))
        for each in device.couplings
        if 3 not in each.qubits
    )
    assert (max(routed.qubits) < 3) == (least[1] < 3)
