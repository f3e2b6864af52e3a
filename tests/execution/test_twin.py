"""The twin of a device reproduces its measured response curves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from qcompile.calibration import Calibration
from qcompile.device import load_device
from qcompile.errors import CalibrationError, CountsError, DeviceError
from qcompile.execution import OfflineExecutor, TwinExecutor, open_executor
from qcompile.ir import Circuit, Program
from qcompile.mitigation import calibrate
from qcompile.noise import usable
from qcompile.passes import compile
from qcompile.policy.layouts import parallel

ONCE_IN_A_MILLION = norm.isf(0.5e-6)
NOTHING = np.zeros(0)
TEXTS = ["ry(x0)", "", "h ry(x0) rz(x1) ry(0.3)", "x", "ry(0.7)", "h", "sx"]
PROGRAM = Program.of(map(Circuit.parse, TEXTS), inputs=2)
X = np.random.default_rng(0).uniform(-4, 4, (50, 2))


def exact(name: str = "fake_lima", **settings: object) -> Calibration:
    device = load_device(name)
    return calibrate(OfflineExecutor(device), np.arange(len(device.qubits)), None, **settings)  # type: ignore[arg-type]


def test_a_twin_is_the_curve_by_hand() -> None:
    calibration = exact(parts=["response"])
    twin = TwinExecutor(calibration)
    assert twin.kind == "measured-response"
    executable = compile(Program.of([Circuit.parse("ry(x0)")], inputs=1), twin.device)
    assert calibration.response is not None
    b, c, s = calibration.response.curves[executable.qubits[0]]
    native = X[:, :1] + np.pi
    found = twin.expectation(executable, X[:, :1], NOTHING)
    np.testing.assert_allclose(found, b + c * np.cos(native) + s * np.sin(native), atol=1e-12)


@pytest.mark.parametrize("name", ["fake_lima", "fake_toronto"])
def test_a_twin_of_an_exact_calibration_is_the_noise_model(name: str) -> None:
    """Circuits of nothing, x and sx among them."""
    twin, offline = TwinExecutor(exact(name)), OfflineExecutor(load_device(name))
    executable = compile(PROGRAM, twin.device)
    gates = [" ".join(g.name for g in c.gates) for c in executable.native.circuits]
    assert {"", "x", "sx", "sx rz sx"} <= set(gates)
    same = compile(PROGRAM, offline.device)
    np.testing.assert_array_equal(same.qubits, executable.qubits)
    expected = offline.expectation(same, X, NOTHING)
    np.testing.assert_allclose(twin.expectation(executable, X, NOTHING), expected, atol=2e-6)


def test_without_readout_nothing_and_x_lie_on_the_curve() -> None:
    twin = TwinExecutor(exact(parts=["response"]))
    program = Program.of(map(Circuit.parse, ["", "x", "ry(x0)", "ry(x0)"]), inputs=1)
    executable = compile(program, twin.device)
    executable = replace(executable, qubits=np.zeros(4, dtype=int))
    z = twin.expectation(executable, np.array([[0.0], [np.pi]]), NOTHING)
    assert z[0, 0] == pytest.approx(z[0, 2], abs=1e-12)
    assert z[0, 1] == pytest.approx(z[1, 2], abs=1e-12)


def test_sx_alone_lies_where_a_quarter_turn_of_the_bound_circuit_does() -> None:
    """At the angle pi/2 + pi: b - s by hand, and the <Z> of h ry(0) rz(0) ry(0)."""
    exactly = exact(parts=["response"])
    assert exactly.response is not None
    curves = ((0.01, -0.9, 0.05),) * 5
    response = exactly.response.model_copy(update={"curves": curves})
    twin = TwinExecutor(exactly.model_copy(update={"response": response}))
    for texts, gates in ((["sx"], "sx"), (["h ry(x0) rz(x0) ry(theta0)"], "sx rz sx")):
        program = Program.of(map(Circuit.parse, texts), inputs=1, parameters=1)
        executable = compile(program, twin.device)
        assert " ".join(g.name for g in executable.native.circuits[0].gates) == gates
        z = twin.expectation(executable, np.zeros((1, 1)), np.zeros(1))
        assert z[0, 0] == pytest.approx(0.01 - 0.05, abs=1e-12)


@pytest.mark.parametrize("level", [0, 1])
def test_other_levels_are_refused(level: int) -> None:
    twin = TwinExecutor(exact())
    executable = compile(PROGRAM, twin.device, level)
    with pytest.raises(CalibrationError, match=r"runs sx rz sx, found[^\n]*\n  Use level 2"):
        twin.run(executable, X, NOTHING, 100)


def test_counts_are_binomial_and_repeat_with_their_seed() -> None:
    calibration, shots = exact(), 400
    twins = [TwinExecutor(calibration, seed) for seed in (3, 3, 4)]
    program, _ = parallel(3, 1)
    executable = compile(program, twins[0].device)
    x, theta = np.tile([[0.1, 0.5, -0.8]], (3000, 1)), np.array([0.2, 1.0, -2.0])
    first, again, other = (twin.run(executable, x, theta, shots) for twin in twins)
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    p = (1 - twins[0].expectation(executable, x[:1], theta)[0]) / 2
    spread = np.sqrt(p * (1 - p) * shots)
    bound = ONCE_IN_A_MILLION * spread / np.sqrt(len(x))
    assert (np.abs(first.mean(axis=0) - p * shots) < bound).all()
    ratio = first.std(axis=0) / spread
    assert (np.abs(ratio - 1) < ONCE_IN_A_MILLION / np.sqrt(2 * len(x))).all()
    with pytest.raises(CountsError):
        twins[0].run(executable, x, theta, 0)


def test_circuits_are_placed_on_calibrated_qubits_only() -> None:
    """Even if the device had chosen its qubits before, which it remembers."""
    device = load_device("fake_lima")
    assert len(usable(device)) == 5
    calibration = calibrate(OfflineExecutor(device, 0), np.array([1, 4, 3]), 1000)
    twin = TwinExecutor(calibration)
    assert twin.device.left_out == (0, 2)
    assert set(usable(twin.device)) == {1, 3, 4}
    executable = compile(parallel(5, 1)[0], twin.device)
    assert set(executable.qubits) <= {1, 3, 4}
    assert executable.round_count == 2
    twin.run(executable, np.zeros((1, 5)), np.zeros(5), 10)


def test_qubits_that_the_device_leaves_out_are_left_out_of_its_twin() -> None:
    """Though they were calibrated: measured on purpose they may be, chosen never."""
    device = load_device("fake_lima").model_copy(update={"left_out": (1, 2)})
    calibration = calibrate(OfflineExecutor(device, 0), np.arange(4), 1000, parts=["response"])
    twin = TwinExecutor(calibration)
    assert twin.device.left_out == (1, 2, 4)
    assert set(compile(parallel(5, 1)[0], twin.device).qubits) == {0, 3}


def test_a_file_is_opened_as_a_twin(tmp_path: Path) -> None:
    calibration = exact()
    calibration.save(tmp_path / "lima.json")
    opened = open_executor(str(tmp_path / "lima.json"), 0)
    assert isinstance(opened, TwinExecutor)
    assert opened.calibration == calibration
    assert isinstance(open_executor("fake_lima", 0), OfflineExecutor)


def test_a_twin_refuses_missing_curves() -> None:
    with pytest.raises(CalibrationError, match="of fake_lima has no response curves"):
        TwinExecutor(exact(parts=["readout"]))
    twin = TwinExecutor(exact())
    with pytest.raises(DeviceError, match="compiled for fake_lagos, this executor runs fake_lima"):
        twin.expectation(compile(PROGRAM, load_device("fake_lagos")), X, NOTHING)
