"""The executor of a live backend: counts follow the noise of every qubit, whatever the batch."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from live_runs import surprises
from standin import StandIn

from qcompile.device import load_device
from qcompile.errors import CircuitError, CountsError, DeviceError
from qcompile.execution import OfflineExecutor, PrimitiveExecutor
from qcompile.ir import Circuit, Program
from qcompile.noise import usable
from qcompile.passes import Executable, compile

SHOTS = 4000
NOTHING = np.zeros((1, 0)), np.zeros(0)
Make = Callable[..., PrimitiveExecutor]


def p_one(executable: Executable, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    return (1 - OfflineExecutor(executable.device).expectation(executable, x, theta)) / 2


def turns(
    circuits: int, executor: PrimitiveExecutor, level: int = 2
) -> tuple[Executable, np.ndarray]:
    """Circuits ry(x0) rz(theta0) ry(x1), and inputs that point everywhere."""
    program = Program.of([Circuit.parse("ry(x0) rz(theta0) ry(x1)")] * circuits, 2, 1)
    return compile(program, executor.device, level), np.array([0.8])


X = np.array([[0, 0], [np.pi, 0], [1.1, 0.4], [-2.0, 1.0], [0.5, 2.5]])


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("batch", [1, 5])
def test_counts_follow_the_noise_of_every_qubit(
    executor_on: Make, service: StandIn, batch: int, level: int
) -> None:
    """It differs from the same device with its qubits in another order."""
    executor = executor_on("fake_lima")
    executable, theta = turns(5, executor, level)
    assert sorted(executable.qubits) == list(range(5))
    x = X[-batch:]
    ones = executor.run(executable, x, theta, SHOTS)
    assert ones.shape == (batch, 5)
    assert ones.dtype == np.int64
    assert not surprises(ones, SHOTS, p_one(executable, x, theta)).any()
    rotated = dataclasses.replace(executable, qubits=(executable.qubits + 2) % 5)
    assert surprises(ones, SHOTS, p_one(rotated, x, theta)).any()
    [job] = service.ledger().jobs
    assert (job.circuits, job.executions) == (batch, batch * SHOTS)


def test_every_qubit_of_the_largest_machine(executor_on: Make, service: StandIn) -> None:
    executor = executor_on("fake_sherbrooke")
    count = len(usable(executor.device))
    executable, theta = turns(count, executor)
    assert (executable.round_count, len(set(executable.qubits))) == (1, count)
    assert count > 100
    ones = executor.run(executable, X, theta, SHOTS)
    assert not surprises(ones, SHOTS, p_one(executable, X, theta)).any()
    assert [job.circuits for job in service.ledger().jobs] == [len(X)]


@pytest.mark.parametrize("batch", [1, 3])
def test_circuits_that_do_not_fit_take_rounds_of_one_job(
    executor_on: Make, service: StandIn, batch: int
) -> None:
    """Each circuit has its own <Z>: none may land in another's column."""
    executor, shots = executor_on("fake_lima"), 20_000
    texts = [f"ry({0.2 + 0.24 * i:.2f}) rz(x0)" for i in range(12)]
    texts[::2] = [f"{text} ry(x0)" for text in texts[::2]]
    executable = compile(Program.of(map(Circuit.parse, texts), inputs=1), executor.device)
    assert executable.round_count == 3
    x = np.linspace(0.1, 0.5, batch)[:, None]
    ones = executor.run(executable, x, NOTHING[1], shots)
    expected = p_one(executable, x, NOTHING[1])
    assert not surprises(ones, shots, expected).any()
    assert surprises(ones[:, ::-1], shots, expected).mean() > 0.8
    [job] = service.ledger().jobs
    assert (job.circuits, job.executions) == (3 * batch, 3 * batch * shots)


@pytest.mark.parametrize("batch", [1, 4])
def test_circuits_without_open_angles(executor_on: Make, service: StandIn, batch: int) -> None:
    executor = executor_on("fake_lima")
    program = Program.of(map(Circuit.parse, ["", "x", "h", "x", ""]))
    executable = compile(program, executor.device)
    x, theta = np.zeros((batch, 0)), NOTHING[1]
    ones = executor.run(executable, x, theta, SHOTS)
    assert ones.shape == (batch, 5)
    assert not surprises(ones, SHOTS, p_one(executable, x, theta)).any()
    assert (ones[:, [0, 4]] < SHOTS / 4).all()
    assert (ones[:, [1, 3]] > 3 * SHOTS / 4).all()
    [job] = service.ledger().jobs
    assert job.executions == batch * SHOTS


def test_open_and_fixed_circuits_side_by_side(executor_on: Make) -> None:
    executor = executor_on("fake_lima")
    program = Program.of(map(Circuit.parse, ["x", "ry(x0)", "", "ry(x0) rz(1.0)"]), inputs=1)
    executable = compile(program, executor.device)
    x = np.array([[0.3], [2.8]])
    ones = executor.run(executable, x, NOTHING[1], SHOTS)
    assert not surprises(ones, SHOTS, p_one(executable, x, NOTHING[1])).any()


def test_nothing_to_measure_sends_nothing(executor_on: Make, service: StandIn) -> None:
    executor = executor_on("fake_lima")
    executable, theta = turns(3, executor)
    assert executor.run(executable, np.zeros((0, 2)), theta, 10).shape == (0, 3)
    assert not service.ledger().jobs


def test_what_cannot_be_run_is_refused_before_it_is_sent(
    executor_on: Make, service: StandIn
) -> None:
    executor = executor_on("fake_lima")
    executable, theta = turns(2, executor)
    with pytest.raises(CountsError):
        executor.run(executable, X, theta, 0)
    with pytest.raises(CountsError):
        executor.run(executable, X, theta, 10_000_001)
    with pytest.raises(CircuitError):
        executor.run(executable, X[:, :1], theta, 10)
    with pytest.raises(DeviceError):
        executor.run(compile(executable.source, load_device("fake_toronto")), X, theta, 10)
    with pytest.raises(CountsError, match="fake_lima runs through a sampler, which needs shots"):
        executor.expectation(executable, X, theta)
    assert not service.ledger().jobs
    assert executor.kind == "hardware"
