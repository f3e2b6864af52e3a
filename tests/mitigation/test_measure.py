"""The circuits of a calibration, and fits that recover the device."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from qcompile.device import Device, GateCalibration, Qubit, load_device
from qcompile.errors import CalibrationError, CountsError
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import CALIBRATION_SHOTS, calibrate, readout_mitigation
from qcompile.mitigation.measure import RESPONSE_ANGLES_RAD, fit_counts, patterns
from qcompile.mitigation.orders import angle_orders
from qcompile.noise import noise_after, readout_row, rotation_map
from qcompile.passes import compile
from qcompile.policy.layouts import parallel

ONCE_IN_A_MILLION = norm.isf(0.5e-6)
Noiseless = Callable[[str], Device]


@pytest.mark.parametrize("qubits", [1, 2, 3, 4, 5, 8, 9, 27, 127])
def test_patterns_are_balanced_and_tell_qubits_apart(qubits: int) -> None:
    bits = patterns(qubits)
    assert len(bits) == 2 + 2 * int(np.ceil(np.log2(qubits)))
    np.testing.assert_array_equal(bits.sum(axis=0), len(bits) // 2)
    assert len({tuple(column) for column in bits.T}) == qubits
    np.testing.assert_array_equal(bits[:2], [[0] * qubits, [1] * qubits])


def test_a_calibration_finds_the_device_s_own_errors(noiseless_gates: Noiseless) -> None:
    """Within the binomial error, and what eight shots' worth of the others' mean draws."""
    shots, device = 200_000, noiseless_gates("fake_lima")
    found = calibrate(OfflineExecutor(device, 5), np.arange(5), shots)
    assert found.readout is not None
    assert found.response is not None
    assert found.executions == shots * (8 + len(RESPONSE_ANGLES_RAD))
    assert (found.backend, found.kind) == ("fake_lima", "noise-model")
    for name in ("p10", "p01"):
        stated = np.array([getattr(q, name) for q in device.qubits])
        spread = np.sqrt(stated * (1 - stated) / (4 * shots))
        values = np.array(getattr(found.readout, name))
        assert (np.abs(values - stated) < ONCE_IN_A_MILLION * spread + 8 / (4 * shots)).all()
        errors = getattr(found.readout, f"{name}_error")
        np.testing.assert_allclose(errors, spread, rtol=0.05)
    curves = np.array(found.response.curves)
    expected = [[q.p01 - q.p10, -q.contrast, 0] for q in device.qubits]
    errors = np.sqrt(np.diagonal(found.response.covariance, axis1=1, axis2=2))
    assert (np.abs(curves - expected) < ONCE_IN_A_MILLION * errors).all()


def test_exact_calibration_is_the_device_s_own_response() -> None:
    """Gates and readout, multiplied as maps of the Bloch vector; no shots, no scatter."""
    device = load_device("fake_toronto")
    found = [calibrate(OfflineExecutor(device, seed), np.arange(27), None) for seed in (1, 2)]
    assert found[0].response == found[1].response
    assert found[0].readout == found[1].readout
    assert found[0].executions == 0
    assert found[0].readout is not None
    assert found[0].response is not None
    for qubit, (b, c, s) in zip(device.qubits, found[0].response.curves, strict=True):
        sx = noise_after("sx", qubit) @ rotation_map("x", np.pi / 2)
        x = noise_after("x", qubit) @ rotation_map("x", np.pi)
        zero, row = np.array([1.0, 0, 0, 1]), readout_row(qubit)
        for angle in (0.3, 2.0, -1.0):
            z = row @ sx @ rotation_map("z", angle) @ sx @ zero
            assert b + c * np.cos(angle) + s * np.sin(angle) == pytest.approx(z, abs=2e-6)
        number = device.qubits.index(qubit)
        assert 1 - 2 * found[0].readout.p10[number] == pytest.approx(row @ zero, abs=2e-6)
        assert 2 * found[0].readout.p01[number] - 1 == pytest.approx(row @ x @ zero, abs=2e-6)


def test_qubits_are_calibrated_once_under_their_own_numbers(noiseless_gates: Noiseless) -> None:
    device, progress = noiseless_gates("fake_lima"), []
    found = calibrate(
        OfflineExecutor(device, 8),
        np.array([3, 0, 3, 4]),
        None,
        parts=["readout"],
        on_circuit=lambda done, of: progress.append((done, of)),
    )
    assert found.qubits == (0, 3, 4)
    assert found.readout is not None
    assert found.response is found.response_counts is None
    np.testing.assert_allclose(
        found.readout.p01, [device.qubits[q].p01 for q in (0, 3, 4)], atol=1e-6
    )
    assert progress == [(0, 6), (6, 6)]


def test_calibration_of_a_perfect_device_changes_nothing() -> None:
    executor = OfflineExecutor(load_device("ideal"), 0)
    calibration = calibrate(executor, np.arange(3))
    executable = compile(parallel(3, 1)[0])
    z = np.array([[0.2, -1.0, 1.0]])
    np.testing.assert_allclose(readout_mitigation(calibration, executable).apply(z), z, atol=1e-6)
    assert CALIBRATION_SHOTS == 8192


def test_an_rx_device_prepares_one_with_its_own_rx() -> None:
    """|1> is made by Rx(pi), worked by hand: what its noise keeps of r_z counts as p01.

    T1 = T2 = 100 us and 50 ns leave e = exp(-0.0005) of every component; the gate error of 0.02 is
    reached by depolarising with p = 2 (0.02 - (1 - e) / 2) / e. After Rx(pi) r_z is -1, then
    r = 1 - e - e (1 - p), and P(read 0) = (1 - p10) (1 + r) / 2 + p01 (1 - r) / 2.
    """
    gates = {"rx": GateCalibration(error=0.02, length_ns=50)}
    qubit = Qubit(t1_us=100, t2_us=100, p10=0.01, p01=0.03, gates=gates)
    device = Device(name="rx", source="by hand", basis_gates=("rz", "rx"), qubits=(qubit,))
    found = calibrate(OfflineExecutor(device), np.array([0]), None)
    e = np.exp(-0.0005)
    p = 2 * (0.02 - (1 - e) / 2) / e
    r = 1 - e - e * (1 - p)
    zero_of_one = 0.99 * (1 + r) / 2 + 0.03 * (1 - r) / 2
    assert zero_of_one > 0.045
    assert found.readout is not None
    assert found.response is not None
    np.testing.assert_allclose([*found.readout.p10, *found.readout.p01], [0.01, zero_of_one],
                               atol=1e-6)  # fmt: skip
    # rx(a): r_z = (1 - e) + e (1 - p) cos a, seen as 0.02 + 0.96 r_z.
    by_hand = [0.02 + 0.96 * (1 - e), 0.96 * e * (1 - p), 0.0]
    np.testing.assert_allclose(found.response.curves[0], by_hand, atol=1e-6)


class Watched(OfflineExecutor):
    """Keeps what it is asked to run."""

    asked: list[tuple[Any, Any]]

    def run(self, executable: Any, x: Any, theta: Any, shots: int) -> Any:
        self.asked.append((executable, x))
        return super().run(executable, x, theta, shots)


def test_each_qubit_sees_its_angles_in_an_order_of_its_own() -> None:
    """One execution an angle, as ever; the counts stand beside the angles they are of."""
    watched = Watched(load_device("fake_toronto"), 0)
    watched.asked = []
    qubits = np.array([3, 8, 20])
    found = calibrate(watched, qubits, 5000, parts=["response"])
    ((executable, x),) = watched.asked
    assert (len(x), executable.round_count) == (8, 1)
    assert found.response_counts is not None
    angles = angle_orders(RESPONSE_ANGLES_RAD, qubits)
    np.testing.assert_array_equal(found.response_counts.angles, angles)
    np.testing.assert_array_equal(executable.bind(x, np.zeros(0)), angles)
    assert len(np.unique(angles, axis=1).T) == 3
    assert found.response is not None
    for (b, c, s), own, ones in zip(
        found.response.curves, angles.T, zip(*found.response_counts.ones, strict=True), strict=True
    ):
        shown = 1 - 2 * np.array(ones) / 5000
        np.testing.assert_allclose(shown, b + c * np.cos(own) + s * np.sin(own), atol=0.08)


def test_angles_for_circuit_and_qubit_are_taken_as_they_stand() -> None:
    """All alike, the circuits are those of earlier versions, with which journals are resumed."""
    watched = Watched(load_device("fake_lima"), 0)
    watched.asked = []
    alike = np.repeat(RESPONSE_ANGLES_RAD[:, None], 2, axis=1)
    found = calibrate(watched, np.array([1, 4]), 500, parts=["response"], angles_rad=alike)
    ((executable, x),) = watched.asked
    assert executable.native.inputs == ("x0",)
    np.testing.assert_array_equal(x[:, 0], RESPONSE_ANGLES_RAD)
    assert found.response_counts is not None
    np.testing.assert_array_equal(found.response_counts.angles, alike)


def test_stored_counts_are_fitted_again() -> None:
    """With the same fits, on all qubits or on some."""
    whole = calibrate(OfflineExecutor(load_device("fake_lima"), 3), np.arange(5), 1000)
    unfitted = whole.model_copy(update={"readout": None, "response": None, "unfitted": ("why",)})
    assert fit_counts(unfitted) == whole
    some = fit_counts(unfitted, [4, 1])
    assert some.qubits == (1, 4)
    assert some.response is not None
    assert whole.response is not None
    assert some.response.curves == (whole.response.curves[1], whole.response.curves[4])
    assert some.readout is not None
    with pytest.raises(CalibrationError, match="Qubit 7 has no calibration"):
        fit_counts(unfitted, [7])


def test_invalid_requests_are_refused_before_anything_runs() -> None:
    executor = OfflineExecutor(load_device("fake_lima"), 0)
    state = executor.rng.bit_generator.state
    with pytest.raises(CalibrationError, match=r"fake_lima has no qubit 5\.\n  Its qubits are 0 t"):
        calibrate(executor, np.array([0, 5]))
    with pytest.raises(CalibrationError, match="no qubit to calibrate"):
        calibrate(executor, np.array([], dtype=int))
    with pytest.raises(CountsError):
        calibrate(executor, np.array([0]), 0)
    assert executor.rng.bit_generator.state == state
