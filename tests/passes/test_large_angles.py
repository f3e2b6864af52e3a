"""The promise of 1e-12 holds for angles of any size, against mpmath with 1,500 bits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from noisy import noisy_circuits

from qcompile.device import IDEAL, Device, Qubit
from qcompile.errors import CircuitError
from qcompile.ir import Circuit, Program
from qcompile.passes import LEVELS, compile
from qcompile.simulate import Simulator

mpmath.mp.prec = 1500

QUBIT = Qubit(t1_us=100, t2_us=100, p10=0, p01=0)
RX = Device(name="rx", source="test", basis_gates=("rz", "rx"), qubits=(QUBIT,) * 20)
TOLERANCE = 1e-12

BOUND = [
    "ry(1e8)",
    "ry(1e308)",
    "h rz(1e8) ry(0.3)",
    "rx(-123456789.25) rx(0.3) rx(1e15)",
    "h rz(2e9) ry(1e8) ry(0.3) rz(3e7) h",
    "ry(1000) " * 12,
    "rx(1e20) h rz(1e100) sx p(1e200) ry(-1e300) h",
]
SYMBOLIC = [
    "ry(x0)",
    "h ry(x0) rz(x0) ry(theta0)",
    "ry(0.3*x0+1)",
    "ry(x0+0.7*x1-0.1*theta0) rz(x1) rx(theta0+1e9)",
    "rx(1e-7*x0+x1) h rz(0.001*theta0)",
]
POINTS = [(1e8, -3.5e9, 2e7), (1e308, 1e200, -1e100), (0.3, 1e12, 0.1), (255.0, 255.0, 255.0)]


def exact_expectation(circuit: Circuit, values: dict[str, float]) -> float:
    """<Z> by matrices of mpmath."""
    state = mpmath.matrix([1, 0])
    for gate in circuit.gates:
        for axis, angle in gate.rotations:
            total = mpmath.mpf(angle.constant)
            for symbol, coefficient in angle.terms:
                total += mpmath.mpf(coefficient) * mpmath.mpf(values[symbol])
            cos, sin = mpmath.cos(total / 2), mpmath.sin(total / 2)
            if axis == "y":
                state = mpmath.matrix([[cos, -sin], [sin, cos]]) * state
            else:
                turn = mpmath.mpc(cos, sin)
                state = mpmath.matrix([state[0] * mpmath.conj(turn), state[1] * turn])
    return float(1 - 2 * abs(state[1]) ** 2)


@pytest.mark.parametrize("device", [IDEAL, RX], ids=["sx", "rx"])
@pytest.mark.parametrize("level", LEVELS)
def test_numbers_in_a_circuit(level: int, device: Device) -> None:
    program = Program.of(map(Circuit.parse, BOUND))
    native = compile(program, device, level).native
    for before, after in zip(program.circuits, native.circuits, strict=True):
        wanted = exact_expectation(before, {})
        assert abs(exact_expectation(after, {}) - wanted) <= TOLERANCE, f"{before} -> {after}"


def test_the_cosine_of_1e8() -> None:
    program = Program.of([Circuit.parse("ry(1e8)")])
    z = Simulator(program).expectation(np.zeros((1, 0)), np.zeros(0))
    assert z[0, 0] == pytest.approx(-0.3633850893556906, abs=1e-15)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("point", POINTS)
def test_numbers_of_inputs_and_parameters(level: int, point: tuple[float, ...]) -> None:
    program = Program.of(map(Circuit.parse, SYMBOLIC), 2, 1)
    x, theta = np.array([point[:2], [0.3, 0.4]]), np.array(point[2:])
    executable = compile(program, IDEAL, level)
    bound = noisy_circuits(executable).expectation(executable.bind(x, theta))
    turned = noisy_circuits(executable).p_one(*executable.bind_turns(x, theta))
    ideal = Simulator(program).expectation(x, theta)
    for row, features in enumerate(x):
        values = dict(zip(("x0", "x1", "theta0"), [*features, *theta], strict=True))
        wanted = [exact_expectation(circuit, values) for circuit in program.circuits]
        for found in (bound, 1 - 2 * turned, ideal):
            assert np.abs(found[row] - wanted).max() <= TOLERANCE


def test_an_angle_that_is_not_finite_is_refused() -> None:
    program = Program.of([Circuit.parse("h ry(10*x0)")], 1)
    for level in LEVELS:
        with pytest.raises(CircuitError, match="An angle is not finite"):
            compile(program, IDEAL, level).bind(np.array([[1e308]]), np.zeros(0))


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("place", ["x", "theta"])
def test_inputs_and_parameters_that_are_not_finite_are_refused(value: float, place: str) -> None:
    program = Program.of([Circuit.parse("h ry(x0) rz(x0) ry(theta0)")], 1, 1)
    x = np.array([[0.1], [value if place == "x" else 0.2]])
    theta = np.array([value if place == "theta" else 0.3])
    for level in LEVELS:
        executable = compile(program, IDEAL, level)
        for bind in (executable.bind, executable.bind_turns):
            with pytest.raises(CircuitError, match="An angle is not finite"):
                bind(x, theta)
    with pytest.raises(CircuitError, match="An angle is not finite"):
        Simulator(program).expectation(x, theta)
