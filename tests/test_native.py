"""Native gates: the states they prepare, by the matrices of the simulator, and slots."""

from __future__ import annotations

import math

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.quantum_info import Statevector

from qcompile.device import IDEAL, load_device
from qcompile.ir import Angle, Circuit, Gate
from qcompile.native import RX, SX, NativeGates, slots


def bloch(circuit: Circuit) -> np.ndarray:
    """The Bloch vector that Qiskit's own gates make of |0>."""
    built = QuantumCircuit(1)
    for gate in circuit.gates:
        angles = [] if gate.angle is None else [gate.angle.constant]
        getattr(built, gate.name)(*angles, 0)
    state = np.asarray(Statevector(built).data)
    cross = state[0].conj() * state[1]
    return np.array([2 * cross.real, 2 * cross.imag, abs(state[0]) ** 2 - abs(state[1]) ** 2])


@pytest.mark.parametrize(
    ("basis", "native"),
    [
        (("rz", "sx", "x"), SX),
        (("x", "id", "sx", "rz", "cx"), SX),
        (("rz", "rx"), RX),
        (("rz", "sx", "x", "rx"), RX),
    ],
)
def test_fractional_rx_is_taken_where_it_is(basis: tuple[str, ...], native: NativeGates) -> None:
    assert NativeGates.of(basis) == native
    assert (IDEAL.native, load_device("fake_lima").native) == (SX, SX)
    with pytest.raises(ValueError, match=r"holds \['rz', 'sx'\]; it needs rz, sx, x or rz, rx"):
        NativeGates.of(("sx", "rz", "sx"))


@pytest.mark.parametrize("native", [SX, RX], ids=str)
@pytest.mark.parametrize("angle", [-2.0, 0.0, 0.4, math.pi])
def test_the_response_circuit_has_its_offset(native: NativeGates, angle: float) -> None:
    circuit = native.response_circuit(Angle(angle))
    assert {gate.name for gate in circuit.gates} <= {*native.gates}
    assert bloch(circuit)[2] == pytest.approx(math.cos(angle - native.angle_offset_rad))
    assert math.isnan(native.polar_angle_rad(circuit) or 0.0)


@pytest.mark.parametrize("native", [SX, RX], ids=str)
def test_circuits_without_a_rotation_have_their_polar_angle(native: NativeGates) -> None:
    for names, polar_rad in native.polar_rad:
        circuit = Circuit(tuple(map(Gate, names)))
        assert native.polar_angle_rad(circuit) == polar_rad
        assert bloch(circuit)[2] == pytest.approx(math.cos(polar_rad))
    assert native.polar_angle_rad(Circuit.parse("sx sx")) is None
    one = Circuit((Gate.of(native.one, math.pi if native.one == "rx" else None),))
    assert bloch(one)[2] == pytest.approx(-1.0)


def test_a_rotation_is_a_slot_and_a_circuit_has_one_at_least() -> None:
    texts = ["sx rz(0.1) sx rz(x0)", "", "x", "rz(1.0)"]
    owners, positions = slots([*map(Circuit.parse, texts)])
    assert owners.tolist() == [0, 0, 1, 2, 3]
    assert positions.tolist() == [0, 1, 0, 0, 0]
    assert [of.tolist() for of in slots([])] == [[], []]
