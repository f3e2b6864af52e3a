"""Executables: repeated circuits, and cosines and sines computed from <Z>."""

from __future__ import annotations

import numpy as np
import pytest
from noisy import noisy_circuits

from qcompile.device import IDEAL, Device, GateCalibration, Qubit, load_device
from qcompile.execution import OfflineExecutor
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable, compile

CALIBRATED = Qubit(
    t1_us=80, t2_us=60, p10=0.01, p01=0.04,
    gates={"rx": GateCalibration(error=2e-3, length_ns=60)},
)  # fmt: skip
DEVICES = {
    "ideal": IDEAL,
    "fake_lima": load_device("fake_lima"),
    "rx": Device(name="rx", source="by hand", basis_gates=("rz", "rx"), qubits=(CALIBRATED,) * 3),
    "perfect rx": Device(
        name="perfect",
        source="by hand",
        basis_gates=("rz", "rx"),
        qubits=(Qubit(t1_us=1, t2_us=1, p10=0, p01=0),) * 3,
    ),
}
SPECIAL = np.array([0.0, np.pi / 2, np.pi, -np.pi / 2, 1e-9, np.pi - 1e-9])

C, D = "h ry(x0) rz(x0) ry(theta0)", "h ry(x1) rz(x1) ry(theta1)"
PROGRAMS: dict[str, list[str]] = {
    "all polar": [C, D],
    "one": [C],
    "twice": [C, C],
    "again": [C, D, C],
    "twice each": [C, D, C, D],
    "other order": [D, C, D, D],
    "a constant first": ["x", C, D],
    "a constant last": [C, D, "h"],
    "nothing between": [C, "", D],
    "an affine one": [C, "rx(x0)", D],
    "an affine one, shifted": ["ry(x1+0.3)", C],
    "polar plus pi": [C, "ry(x0) ry(theta0) x", D],
    "affine alone": ["rx(x0)", "ry(x1-theta0)"],
    "constants alone": ["x", "h", ""],
    "polar of many": [f"{C} {D}", f"{D} {C}", C],
    "turned over": [f"{C} x", f"{D} x"],
    "half turned over": [f"{C} x", D],
}
WANTS_SPEED = {"all polar", "one", "polar of many", "turned over", "half turned over"}


def closed_form(x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """<Z> of h ry(x) rz(x) ry(theta)."""
    return -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)


def make(program: str, device: str, level: int) -> Executable:
    circuits = map(Circuit.parse, PROGRAMS[program])
    return compile(Program.of(circuits, 2, 2), DEVICES[device], level)


def points() -> tuple[np.ndarray, list[np.ndarray]]:
    """Random x and all pairs of special ones; theta random and special."""
    rng = np.random.default_rng(2)
    pairs = np.stack(np.meshgrid(SPECIAL, SPECIAL), -1).reshape(-1, 2)
    thetas = [rng.uniform(-3, 3, 2), np.zeros(2), np.array([np.pi / 2, -np.pi / 2])]
    return np.concatenate([rng.uniform(-4, 4, (200, 2)), pairs]), thetas


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("device", ["ideal", "perfect rx"])
@pytest.mark.parametrize(
    ("program", "inputs"),
    [("one", [0]), ("twice", [0, 0]), ("again", [0, 1, 0]), ("other order", [1, 0, 1, 1])],
)
def test_repeated_circuits_are_the_closed_form(
    program: str, inputs: list[int], device: str, level: int
) -> None:
    executable = make(program, device, level)
    x, thetas = points()
    executor = OfflineExecutor(executable.device, 1)
    for theta in thetas:
        assert executable.bind(x, theta).shape == (len(x), len(executable.slot_circuits))
        expected = closed_form(x[:, inputs], theta[inputs])
        found = executor.expectation(executable, x, theta)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
        assert executor.run(executable, x, theta, 100).shape == expected.shape


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("program", PROGRAMS)
def test_turns_are_those_of_the_bound_angles(program: str, device: str, level: int) -> None:
    """Near 0 and pi the polar angle has half its digits, and so has its sine."""
    executable = make(program, device, level)
    noisy, (x, thetas), compared = noisy_circuits(executable), points(), 0
    for theta in thetas:
        angles = executable.bind(x, theta)
        cos, sin = executable.bind_turns(x, theta)
        assert cos.shape == sin.shape == angles.shape
        np.testing.assert_allclose(cos, np.cos(angles), rtol=0, atol=1e-12)
        away = np.abs(np.sin(angles)) > 1e-3
        compared += int(away.sum())
        np.testing.assert_allclose(sin[away], np.sin(angles)[away], rtol=0, atol=1e-12)
        np.testing.assert_allclose(sin, np.sin(angles), rtol=0, atol=1e-7)
        p_one = noisy.p_one(cos, sin)
        np.testing.assert_allclose(1 - 2 * p_one, noisy.expectation(angles), rtol=0, atol=1e-12)
    assert compared > 100 or program == "constants alone"


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_short_way_is_taken_only_where_it_is_right(program: str) -> None:
    """The tests above would pass if it never were taken."""
    for device in ("ideal", "rx"):
        polar = [make(program, device, level).has_polar_angles for level in (0, 1, 2)]
        assert polar == [False, False, program in WANTS_SPEED], device
