"""Predistorted angles: the device's response curve then gives the ideal <Z>."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from qcompile.calibration import Calibration
from qcompile.errors import CalibrationError
from qcompile.execution import TwinExecutor
from qcompile.ir import Circuit, Program
from qcompile.mitigation import predistorted
from qcompile.passes import compile
from qcompile.policy.layouts import parallel

NOTHING = np.zeros(0)
CURVES = [[0.03, -0.9, 0.05], [-0.05, 0.8, -0.1], [0.1, 0.2, -0.7]]  # usual, swapped, turned


@pytest.mark.parametrize("basis_gates", [("rz", "sx", "x"), ("rz", "rx")])
@pytest.mark.parametrize("polar", [False, True])
def test_the_measured_expectation_is_the_ideal_one(
    made: Callable[..., Calibration], basis_gates: tuple[str, ...], polar: bool
) -> None:
    """On tilted curves, for angles of both signs and beyond a turn; else the nearest is shown."""
    sign = 1 if "rx" in basis_gates else -1
    curves = [[b, -sign * c, s] for b, c, s in CURVES]
    calibration = made(curves=curves, basis_gates=basis_gates)
    if polar:
        program, theta = parallel(3, 1)[0], np.array([0.3, -2.0, 1.1])
    else:
        program = Program.of(map(Circuit.parse, ["ry(x0)", "ry(2*x1)", "rx(x2)"]), inputs=3)
        theta = NOTHING
    executable = compile(program, calibration.device)
    changed, twin = predistorted(executable, calibration), TwinExecutor(calibration)
    x = np.random.default_rng(0).uniform(-4, 4, (500, 3))
    ideal = np.cos(executable.bind(x, theta) - executable.device.native.angle_offset_rad)
    b, c, s = np.array(curves)[executable.qubits].T
    nearest = np.clip(ideal, b - np.hypot(c, s), b + np.hypot(c, s))
    changed = replace(changed, device=twin.device)
    found = twin.expectation(changed, x, theta)
    np.testing.assert_allclose(found, nearest, rtol=0, atol=1e-9)
    assert (nearest != ideal).any()
    straight = twin.expectation(compile(program, twin.device), x, theta)
    assert np.abs(straight - ideal).max() > 0.1


def test_a_perfect_curve_leaves_the_angles(made: Callable[..., Calibration]) -> None:
    """Up to turns, in [-pi, pi] about the offset."""
    calibration = made(curves=[[0.0, -1.0, 0.0]])
    executable = compile(Program.of([Circuit.parse("ry(x0)")], inputs=1), calibration.device)
    x = np.linspace(-3.1, 3.1, 63)[:, None]
    changed = predistorted(executable, calibration)
    np.testing.assert_allclose(changed.bind(x, NOTHING), executable.bind(x, NOTHING), atol=1e-6)
    cos, sin = changed.bind_turns(x, NOTHING)
    np.testing.assert_array_equal(cos, np.cos(changed.bind(x, NOTHING)))
    np.testing.assert_array_equal(sin, np.sin(changed.bind(x, NOTHING)))


def test_circuits_without_a_rotation_stay_and_constants_are_predistorted(
    made: Callable[..., Calibration],
) -> None:
    calibration = made(curves=CURVES)
    program = Program.of(map(Circuit.parse, ["x", "ry(0.7)", "ry(x0)"]), inputs=1)
    executable = compile(program, calibration.device)
    changed = predistorted(executable, calibration)
    x = np.array([[0.4]])
    straight, turned = executable.bind(x, NOTHING)[0], changed.bind(x, NOTHING)[0]
    assert turned[0] == straight[0] == 0.0
    assert abs(turned[1] - straight[1]) > 1e-3
    # A sampler gets the predistorted constant as a value of its own.
    assert executable.open_slots.tolist() == [2]
    assert changed.open_slots.tolist() == [1, 2]
    assert len(changed.template().inputs) == 2


def test_predistortion_is_refused_where_impossible(made: Callable[..., Calibration]) -> None:
    calibration = made(curves=CURVES)
    program, _ = parallel(3, 1)
    with pytest.raises(CalibrationError, match="need level 2"):
        predistorted(compile(program, calibration.device, 1), calibration)
    changed = predistorted(compile(program, calibration.device), calibration)
    with pytest.raises(CalibrationError, match="already predistorted"):
        predistorted(changed, calibration)
    other = made(readout=([0.1] * 3, [0.1] * 3))
    executable = compile(program, other.device)
    with pytest.raises(CalibrationError, match="no response curves"):
        predistorted(executable, other)
