"""Shots: the binomial law of counts, expectations, limits and cost."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, chi2, norm

from qcompile.device import Device, Qubit, load_device
from qcompile.errors import CountsError, DeviceError
from qcompile.execution import (
    OfflineExecutor,
    check_shots,
    expectation_from_ones,
    qpu_seconds,
)
from qcompile.ir import Circuit, Program
from qcompile.limits import MAX_SHOTS
from qcompile.passes import Executable, compile
from qcompile.policy.layouts import parallel

ONCE_IN_A_MILLION = norm.isf(0.5e-6)

READOUT_ONLY = Device(
    name="readout_only",
    source="made for this test",
    basis_gates=("rz", "sx", "x"),
    qubits=tuple(Qubit(t1_us=1, t2_us=1, p10=0.01 * q, p01=0.03 * q) for q in range(3)),
)
"""Perfect gates; qubit q reads 1 for |0> with 0.01 q and 0 for |1> with 0.03 q."""


def paper(circuits: int, backend: str | Device, level: int = 2) -> Executable:
    device = load_device(backend) if isinstance(backend, str) else backend
    return compile(parallel(circuits, 1)[0], device, level)


def inputs(batch: int, circuits: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (batch, circuits)), rng.uniform(-3, 3, circuits)


def closed_form(x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    return -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)


@pytest.mark.parametrize("shots", [1, 1024, 8192, 10_000_000])
def test_shots_in_range_are_taken(shots: int) -> None:
    assert check_shots(shots) == shots


@pytest.mark.parametrize("shots", [0, -1, 10_000_001])
def test_shots_out_of_range_are_refused(shots: int) -> None:
    assert MAX_SHOTS == 10_000_000
    executable, arguments = paper(2, "ideal"), inputs(1, 2)
    with pytest.raises(CountsError, match=f"{shots} shots cannot be run"):
        check_shots(shots)
    with pytest.raises(CountsError, match=f"{shots} shots cannot be run"):
        OfflineExecutor(executable.device, 0).run(executable, *arguments, shots)
    with pytest.raises(CountsError, match=f"{shots} shots cannot be run"):
        expectation_from_ones(np.array([0]), shots)


def test_expectation_is_one_less_twice_the_share_of_ones() -> None:
    ones = np.array([[0, 8], [4, 6]])
    np.testing.assert_array_equal(expectation_from_ones(ones, 8), [[1, -1], [0, -0.5]])
    assert expectation_from_ones(np.zeros((0, 3), dtype=int), 8).shape == (0, 3)


@pytest.mark.parametrize(("ones", "first"), [([[1, 9], [-1, 0]], 9), ([[1, -2], [10, 0]], -2)])
def test_impossible_counts_are_refused(ones: list[list[int]], first: int) -> None:
    with pytest.raises(CountsError, match=rf"{first} ones in 8 shots\.\n  Give counts from 0 to 8"):
        expectation_from_ones(np.array(ones), 8)


@pytest.mark.parametrize("level", [0, 1, 2])
def test_the_ideal_device_is_the_closed_form(level: int) -> None:
    executable, (x, theta) = paper(6, "ideal", level), inputs(20, 6)
    executor = OfflineExecutor(executable.device)
    assert executor.kind == "ideal"
    found = executor.expectation(executable, x, theta)
    np.testing.assert_allclose(found, closed_form(x, theta), atol=1e-12)


def test_readout_errors_are_worked_by_hand() -> None:
    """P(read 1) = p10 P(0) + (1 - p01) P(1), on the qubit that each circuit is placed on."""
    executable, (x, theta) = paper(3, READOUT_ONLY), inputs(10, 3)
    executor = OfflineExecutor(READOUT_ONLY)
    assert executor.kind == "noise-model"
    p_one = (1 - closed_form(x, theta)) / 2
    q = executable.qubits
    read_one = 0.01 * q * (1 - p_one) + (1 - 0.03 * q) * p_one
    found = executor.expectation(executable, x, theta)
    np.testing.assert_allclose(found, 1 - 2 * read_one, atol=1e-12)


@pytest.mark.parametrize("shots", [1024, 8192])
@pytest.mark.parametrize("backend", ["ideal", "fake_lima"])
def test_counts_have_the_mean_and_variance_of_the_binomial_law(backend: str, shots: int) -> None:
    """The sum of squared z-scores of 4000 counts is chi-square; each bound fails once in 10^6."""
    executable, (x, theta) = paper(5, backend), inputs(800, 5)
    executor = OfflineExecutor(executable.device, seed=11)
    p_one = (1 - executor.expectation(executable, x, theta)) / 2
    ones = executor.run(executable, x, theta, shots)
    assert ones.shape == (800, 5)
    assert np.issubdtype(ones.dtype, np.integer)
    inside = (p_one * shots > 25) & ((1 - p_one) * shots > 25)
    assert inside.sum() > 3000
    z = ((ones - shots * p_one) / np.sqrt(shots * p_one * (1 - p_one)))[inside]
    assert abs(z.sum() / np.sqrt(z.size)) < ONCE_IN_A_MILLION
    assert chi2.isf(1 - 0.5e-6, z.size) < (z**2).sum() < chi2.isf(0.5e-6, z.size)


def test_counts_follow_the_whole_binomial_law() -> None:
    """Pearson's test of 20000 counts of 10 shots against the binomial probabilities."""
    program = Program.of([Circuit.parse("ry(x0)")], 1)
    executable = compile(program, READOUT_ONLY)
    repeats, shots = 20_000, 10
    executor = OfflineExecutor(READOUT_ONLY, seed=12)
    x = np.full((repeats, 1), 1.2)
    p_one = (1 - np.cos(1.2)) / 2
    q = int(executable.qubits[0])
    p_read = 0.01 * q * (1 - p_one) + (1 - 0.03 * q) * p_one
    ones = executor.run(executable, x, np.zeros(0), shots)[:, 0]
    expected = repeats * binom.pmf(np.arange(shots + 1), shots, p_read)
    found = np.bincount(ones, minlength=shots + 1).astype(float)
    rare = expected < 10
    expected = np.append(expected[~rare], expected[rare].sum())
    found = np.append(found[~rare], found[rare].sum())
    assert ((found - expected) ** 2 / expected).sum() < chi2.isf(1e-6, len(expected) - 1)


def test_circuits_are_drawn_independently() -> None:
    """Neighbouring columns of the same circuit: their correlation is zero within 1/sqrt(N)."""
    program = Program.of([Circuit.parse("ry(x0)")] * 2, 1)
    executable = compile(program, load_device("ideal"))
    executor = OfflineExecutor(executable.device, seed=13)
    ones = executor.run(executable, np.full((10_000, 1), 1.3), np.zeros(0), 100)
    correlation = np.corrcoef(ones.T)[0, 1]
    assert abs(correlation) < ONCE_IN_A_MILLION / np.sqrt(10_000)


def test_the_same_seed_gives_the_same_counts() -> None:
    executable, arguments = paper(5, "fake_lima"), inputs(50, 5)

    def run(seed: int) -> list[list[list[int]]]:
        executor = OfflineExecutor(executable.device, seed)
        return [executor.run(executable, *arguments, 1024).tolist() for _ in range(2)]

    first, again, other = run(3), run(3), run(4)
    assert first == again
    assert first != other
    assert first[0] != first[1], "two calls drew the same noise"


def test_certain_outcomes_have_no_noise() -> None:
    program = Program.of([Circuit(), Circuit.parse("x"), Circuit.parse("ry(x0)")], 1)
    executable = compile(program, load_device("ideal"))
    executor = OfflineExecutor(executable.device, 0)
    ones = executor.run(executable, np.array([[np.pi], [0.0], [-np.pi]]), np.zeros(0), 4096)
    assert ones.tolist() == [[0, 4096, 4096], [0, 4096, 0], [0, 4096, 4096]]


def test_probabilities_that_rounding_carries_below_zero_are_zero() -> None:
    """Gates undone by later ones: P(1) is 0, computed as -1e-16 for some angles."""
    there = np.random.default_rng(0).uniform(-3, 3, (500, 2))
    program = Program.of([Circuit.parse("ry(x0) rz(x1) rz(x3) ry(x2)")], 4)
    executable = compile(program, load_device("ideal"), 0)
    executor = OfflineExecutor(executable.device, 0)
    x = np.hstack([there, -there])
    assert (executor.expectation(executable, x, np.zeros(0)) > 1).any(), "no rounding to be tested"
    assert not executor.run(executable, x, np.zeros(0), 100).any()


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_batch_is_its_rows(level: int) -> None:
    executable, (x, theta) = paper(7, "fake_lima", level), inputs(9, 7)
    assert executable.round_count == 2
    executor = OfflineExecutor(executable.device)
    rows = [executor.expectation(executable, row[None], theta)[0] for row in x]
    np.testing.assert_allclose(executor.expectation(executable, x, theta), rows, atol=1e-15)
    assert executor.run(executable, x[:0], theta, 10).shape == (0, 7)


def test_one_executor_serves_many_executables() -> None:
    """Two programs in turn: the second does not inherit the maps of the first."""
    (x, theta), device = inputs(4, 3), load_device("fake_lima")
    programs = [parallel(3, 1)[0], Program.of([Circuit.parse(f"ry(x{i})") for i in range(3)], 3, 3)]
    both = [compile(program, device) for program in programs]
    shared = OfflineExecutor(device)
    for executable in (*both, *both):
        alone = OfflineExecutor(device).expectation(executable, x, theta)
        np.testing.assert_array_equal(shared.expectation(executable, x, theta), alone)


def test_an_executable_of_another_device_is_refused() -> None:
    executable, arguments = paper(3, "ibm_lima"), inputs(1, 3)
    with pytest.raises(DeviceError, match="compiled for ibm_lima, this executor runs fake_lima"):
        OfflineExecutor(load_device("fake_lima")).run(executable, *arguments, 10)
    equal = OfflineExecutor(load_device("ibmq_lima"), 0)
    assert equal.run(executable, *arguments, 10).shape == (1, 3)


def test_qpu_seconds_of_the_design_notes() -> None:
    """An episode of 300 steps, 24 circuits each at 8192 shots.

    One circuit a job: 7200 jobs at 2 s and 58,982,400 executions at 0.35 ms. Packed: 300 jobs and
    2,457,600 executions.
    """
    assert qpu_seconds(7200, 58_982_400) == pytest.approx(14_400 + 20_643.84)
    assert qpu_seconds(300, 2_457_600) == pytest.approx(600 + 860.16)
    assert qpu_seconds(0, 0) == 0
