"""Prepared executables: prepared once, exact if possible, with a one-line repr."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.arrays import CountArray, FloatArray
from qcompile.device import load_device
from qcompile.errors import CountsError
from qcompile.execution import (
    Executor,
    OfflineExecutor,
    Prepared,
    TwinExecutor,
    draw_ones,
    require_exact,
)
from qcompile.ir import Circuit, Program
from qcompile.mitigation import calibrate
from qcompile.noise import NoisyCircuits
from qcompile.passes import Executable, compile

DEVICE = load_device("fake_lima")
PROGRAM = Program.of(map(Circuit.parse, ["ry(x0)", "x", "ry(x0) rz(x0) ry(0.3)"]), 1)
X, NOTHING = np.linspace(-2, 2, 5)[:, None], np.zeros(0)


class Counting(OfflineExecutor):
    """Counts how often an executable is prepared."""

    times = 0

    def prepare(self, executable: Executable):  # type: ignore[no-untyped-def]
        self.times += 1
        return super().prepare(executable)


def test_an_executable_is_prepared_once() -> None:
    executor = Counting(DEVICE, 0)
    first, second = compile(PROGRAM, DEVICE), compile(PROGRAM, DEVICE, 1)
    for executable in (first, first, second, second):
        executor.run(executable, X, NOTHING, 10)
        executor.expectation(executable, X, NOTHING)
    assert executor.times == 2


@pytest.mark.parametrize("twin", [False, True])
def test_a_prepared_executable_agrees_with_its_executor(twin: bool) -> None:
    calibration = calibrate(OfflineExecutor(DEVICE), np.arange(5), None)

    def opened() -> Executor:
        return TwinExecutor(calibration, 3) if twin else OfflineExecutor(DEVICE, 3)

    executable = compile(PROGRAM, DEVICE)
    executor, prepared = opened(), opened().prepare(executable)
    for _ in range(2):
        np.testing.assert_array_equal(
            prepared.ones(X, NOTHING, 50), executor.run(executable, X, NOTHING, 50)
        )
    np.testing.assert_array_equal(
        require_exact(prepared).expectation(X, NOTHING),
        executor.expectation(executable, X, NOTHING),
    )


def test_an_executor_that_needs_shots_says_so() -> None:
    class Coin(Prepared):
        shots_only = ("A coin only has shots.", "Throw it.")

        def ones(self, x: FloatArray, theta: FloatArray, shots: int) -> CountArray:
            raise AssertionError("nobody throws it")

    with pytest.raises(CountsError) as refused:
        require_exact(Coin(compile(PROGRAM, DEVICE)))
    assert str(refused.value) == "A coin only has shots.\n  Throw it."


def test_probabilities_are_rounded_into_their_range() -> None:
    rng = np.random.default_rng(0)
    ones = draw_ones(rng, 7, np.array([[-1e-16, 1 + 3e-16, 0.0, 1.0]]))
    assert ones.tolist() == [[0, 7, 0, 7]]


def test_in_print_they_are_one_line() -> None:
    executable = compile(Program.of([Circuit.parse("ry(x0)")] * 7, 1), DEVICE)
    noisy = NoisyCircuits(executable.native.circuits, DEVICE, executable.qubits)
    assert repr(executable) == "Executable(7 circuits on fake_lima, level 2, rounds 2)"
    assert repr(noisy) == "NoisyCircuits(7 circuits on fake_lima)"
    assert repr(OfflineExecutor(DEVICE)) == "OfflineExecutor(fake_lima)"
