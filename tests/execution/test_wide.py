"""Executables with circuits of several qubits on noise models, against Aer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from wide_aer import by_aer, noisy_simulator

import qcompile
from qcompile.errors import CircuitError
from qcompile.execution import OfflineExecutor
from qcompile.ir import Circuit, Program
from qcompile.policy.layouts import ring
from qcompile.streams import Draws

LAYER = [["ry", "x0", 0], ["ry", "x1", 1], ["rx", "x0", 2], ["cz", 0, 1], ["cz", 1, 2]]
BLOCK = Circuit.of([*LAYER, ["ry", "theta0", 0], ["rz", "theta1", 1], ["ry", 0.3, 2], *LAYER], 3)
OBSERVABLES = ((0,), (0, 1), (1, 2), (0, 1, 2), (3,))
X = np.random.default_rng(5).uniform(-2, 2, (7, 2))
THETA = np.array([0.4, -1.3])


def program() -> Program:
    """A circuit on three qubits beside one on a single qubit."""
    circuits = [BLOCK, Circuit.parse("h ry(x1)")]
    return replace(Program.of(circuits, 2, 2), observables=OBSERVABLES)


def ideal(program: Program, x: np.ndarray, theta: np.ndarray = THETA) -> np.ndarray:
    """<O> of all observables for one row, from Qiskit's statevector."""
    from qiskit import QuantumCircuit
    from qiskit.quantum_info import SparsePauliOp, Statevector

    values = dict(zip(program.symbols, [*x, *theta], strict=True))
    built = QuantumCircuit(program.bits)
    for first, circuit in zip(program.first_bits, program.circuits, strict=True):
        for gate in circuit.substitute(values).gates:
            angle = () if gate.angle is None else (gate.angle.constant,)
            getattr(built, gate.name)(*angle, *(first + qubit for qubit in gate.qubits))
    state = Statevector(built)
    return np.array(
        [
            state.expectation_value(
                SparsePauliOp.from_sparse_list([("Z" * len(o), o, 1.0)], program.bits)
            ).real
            for o in program.measured
        ]
    )


@pytest.mark.parametrize("level", [0, 1, 2])
def test_without_noise_it_is_the_statevector(level: int) -> None:
    executable = qcompile.compile(program(), qcompile.load_device("ideal"), level)
    found = OfflineExecutor(executable.device).expectation(executable, X, THETA)
    np.testing.assert_allclose(found, [ideal(program(), x) for x in X], atol=1e-12)


@pytest.mark.parametrize("name", ["fake_lima", "fake_jakarta"])
@pytest.mark.parametrize("level", [0, 1, 2])
def test_with_noise_it_is_aer(name: str, level: int) -> None:
    """The native circuit, qubits and all, in Aer's density matrix with the backend's noise."""
    device = qcompile.load_device(name)
    wide = replace(program(), circuits=(BLOCK,), observables=((0,), (1,), (2,), (0, 1, 2)))
    executable = qcompile.compile(wide, device, level)
    found = OfflineExecutor(device).expectation(executable, X, THETA)
    simulator = noisy_simulator(name)
    for row, x in zip(found, X, strict=True):
        np.testing.assert_allclose(row, by_aer(executable, x, THETA, simulator), atol=1e-9)


def test_counts_are_odd_parities_of_joint_shots() -> None:
    """Products are those of the same shots: <ZZ> of a state with equal qubits is always even."""
    bell = replace(Program.of([Circuit.parse("h@0 cx@0,1", 2)]), observables=((0,), (1,), (0, 1)))
    executable = qcompile.compile(bell, qcompile.load_device("ideal"))
    executor = OfflineExecutor(executable.device, seed=0)
    ones = executor.run(executable, np.zeros((500, 0)), np.zeros(0), 64)
    np.testing.assert_array_equal(ones[:, 0], ones[:, 1])
    assert not ones[:, 2].any()
    assert abs(ones[:, 0].mean() - 32) < 4 * 4 / np.sqrt(500)


def test_counts_agree_with_expectations() -> None:
    device = qcompile.load_device("fake_lima")
    executable = qcompile.compile(program(), device)
    executor = OfflineExecutor(device, seed=1)
    x = np.repeat(X[:1], 4000, axis=0)
    ones = executor.run(executable, x, THETA, 32)
    p = (1 - executor.expectation(executable, x, THETA)[0]) / 2
    sigma = np.sqrt(p * (1 - p) / (32 * 4000))
    assert (np.abs(ones.mean(axis=0) / 32 - p) < 4.5 * sigma).all()


def test_keyed_counts_repeat_alone_and_in_any_copy() -> None:
    ideal_device = qcompile.load_device("ideal")
    one = qcompile.compile(program(), ideal_device)
    two = qcompile.compile(program(), ideal_device, copies=2)
    executor, draws = OfflineExecutor(ideal_device), Draws(9, 2)
    episode, decision = np.arange(4)[:, None], np.full((4, 1), 3)
    alone = executor.prepare(one).ones(X[:4], THETA, 100, draws.rows(episode, decision))
    pairs = X[:4].reshape(2, 4)
    beside = executor.prepare(two).ones(
        pairs, THETA, 100, draws.rows(episode.reshape(2, 2), decision.reshape(2, 2))
    )
    np.testing.assert_array_equal(beside.reshape(4, -1), alone)


def chain(width: int) -> Program:
    """Rotations and a chain of couplings, twice; <Z> of the ends, and their product."""
    layer = [["ry", "x0", q] for q in range(width)] + [["rz", "x1", q] for q in range(width)]
    layer += [["cx", q, q + 1] for q in range(width - 1)]
    layer += [["ry", "theta0", q] for q in range(width)]
    observables = ((0,), (width - 1,), (0, width - 1), tuple(range(width)))
    return replace(Program.of([Circuit.of(layer, width)], 2, 2), observables=observables)


def test_more_than_8_qubits_go_through_aer() -> None:
    """9 qubits on a line of 16, with noise, beside Aer with the backend's own model."""
    device = qcompile.load_device("fake_toronto")
    executable = qcompile.compile(chain(9), device)
    assert executable.native.widths == (9,)
    x, simulator = X[:2], noisy_simulator("fake_toronto")
    found = OfflineExecutor(device).expectation(executable, x, THETA)
    for row, of_row in zip(found, x, strict=True):
        np.testing.assert_allclose(row, by_aer(executable, of_row, THETA, simulator), atol=1e-9)
    ones = OfflineExecutor(device, seed=0).run(executable, x, THETA, 64)
    assert ones.shape == (2, 4)


def test_single_precision_is_close() -> None:
    device = qcompile.load_device("fake_lima")
    executable = qcompile.compile(program(), device)
    exact = OfflineExecutor(device).expectation(executable, X, THETA)
    single = OfflineExecutor(device, dtype=np.float32).expectation(executable, X, THETA)
    assert single.dtype == np.float64
    assert 0 < np.abs(single - exact).max() < 1e-5
    with pytest.raises(qcompile.OptionError, match=r"numpy\.float64 or numpy\.float32"):
        OfflineExecutor(device, dtype=int)  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "width", "most"), [("fake_toronto", 13, 12), ("ideal", 17, 16)])
def test_a_circuit_too_wide_for_its_noise_is_refused(name: str, width: int, most: int) -> None:
    device = qcompile.load_device(name)
    executable = qcompile.compile(chain(width), device)
    words = rf"{width} qubits on {name}.\n.*up to {most} qubits"
    with pytest.raises(CircuitError, match=words):
        OfflineExecutor(device).prepare(executable)


def test_many_perfect_qubits_are_played() -> None:
    """Ten qubits in a ring; and an empty batch."""
    many, _ = ring(10, 1)
    rng = np.random.default_rng(3)
    x, theta = rng.uniform(-2, 2, (2, 10)), rng.uniform(-2, 2, 40)
    executable = qcompile.compile(many, qcompile.load_device("ideal"))
    executor = OfflineExecutor(executable.device)
    found = executor.expectation(executable, x, theta)
    np.testing.assert_allclose(found, [ideal(many, row, theta) for row in x], atol=1e-12)
    assert executor.expectation(executable, x[:0], theta).shape == (0, 10)
