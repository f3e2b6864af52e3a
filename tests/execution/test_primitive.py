"""The Qiskit sampler: the same noise as ours, bits in order, one job, errors and seeds."""

from __future__ import annotations

import dataclasses
import sys
import warnings
from typing import Any

import numpy as np
import pytest
from noisy import noisy_circuits
from qiskit import QuantumCircuit
from qiskit.exceptions import QiskitError
from qiskit.primitives import BackendSamplerV2, StatevectorSampler
from qiskit.providers.fake_provider import GenericBackendV2
from qiskit_aer import AerSimulator
from qiskit_aer.primitives import SamplerV2 as AerSampler
from scipy.stats import binom

from qcompile.device import Device, load_device
from qcompile.errors import CircuitError, CountsError, DeviceError, MissingExtraError
from qcompile.execution import OfflineExecutor, PrimitiveExecutor, open_executor
from qcompile.execution.primitive import sampler_kind
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable, compile
from qcompile.policy.layouts import parallel
from qcompile.snapshot import find_backend

FALSE_ALARMS = 1e-7
"""Of each statistical test; there are fewer than ten."""

LIMA = PrimitiveExecutor(find_backend("FakeLimaV2"), seed=5)


def surprises(ones: np.ndarray, shots: int, p_one: np.ndarray) -> np.ndarray:
    """Where ones lie in a tail of their binomial law: all within bounds but for FALSE_ALARMS."""
    least = FALSE_ALARMS / ones.size / 2
    return (binom.cdf(ones, shots, p_one) < least) | (binom.sf(ones - 1, shots, p_one) < least)


def p_one(executable: Executable, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
    return (1 - OfflineExecutor(executable.device).expectation(executable, x, theta)) / 2


def paper(circuits: int, level: int = 2, device: Device = LIMA.device) -> Executable:
    return compile(parallel(circuits, 1)[0], device, level)


def inputs(batch: int, circuits: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.5, 1.5, (batch, circuits)), rng.uniform(-3, 3, circuits)


def symmetrised(device: Device) -> Device:
    """The device as AerSimulator.from_backend reads it: one readout error for both states."""
    qubits = [
        q.model_copy(update={"p10": (q.p10 + q.p01) / 2, "p01": (q.p10 + q.p01) / 2})
        for q in device.qubits
    ]
    return device.model_copy(update={"qubits": tuple(qubits)})


@pytest.mark.parametrize("level", [0, 1, 2])
def test_ones_follow_our_noise_model_on_every_qubit(level: int) -> None:
    """And not the model with symmetric readout, on any of the five."""
    program = Program.of([Circuit.parse("ry(x0) rz(theta0) ry(x1)")] * 5, 2, 1)
    executable = compile(program, LIMA.device, level)
    assert sorted(executable.qubits) == list(range(5))
    x = np.array([[0, 0], [np.pi, 0], [1.1, 0.4], [-2.0, 1.0], [0.5, 2.5], [3.0, -1.7]])
    theta, shots = np.array([0.8]), 16_000
    ones = LIMA.run(executable, x, theta, shots)
    assert ones.shape == (6, 5)
    assert ones.dtype == np.int64
    assert not surprises(ones, shots, p_one(executable, x, theta)).any()
    wrong = dataclasses.replace(executable, device=symmetrised(LIMA.device))
    p_wrong = p_one(wrong, x, theta)
    first = executable.qubits == 0
    assert np.abs(p_wrong - p_one(executable, x, theta))[:2, first].min() > 0.01
    assert surprises(ones, shots, p_wrong)[:2].all()


@pytest.mark.parametrize("name", ["fake_lima", "fake_oslo"])
def test_the_gate_noise_is_ours_exactly(name: str) -> None:
    """Aer's density matrix before readout, on all qubits; one of Oslo's has T2 > 2 T1."""
    executor = PrimitiveExecutor(find_backend(name))
    device = executor.device
    assert (name == "fake_oslo") == any(q.t2_us > 2 * q.t1_us for q in device.qubits)
    perfect = [q.model_copy(update={"p10": 0.0, "p01": 0.0}) for q in device.qubits]
    program = Program.of([Circuit.parse("sx id rz(x0) sx x id rz(0.3) sx")] * len(perfect), 1)
    executable = dataclasses.replace(
        compile(program, device, 0),
        device=device.model_copy(update={"qubits": tuple(perfect)}),
        qubits=np.arange(len(perfect)),
    )
    theirs = []
    for qubit in range(len(perfect)):
        made = QuantumCircuit(len(perfect))
        made.sx(qubit), made.id(qubit), made.rz(0.9, qubit), made.sx(qubit)
        made.x(qubit), made.id(qubit), made.rz(0.3, qubit), made.sx(qubit)
        made.save_density_matrix([qubit])
        theirs.append(made)
    executor._simulator.set_options(method="density_matrix")
    result = executor._simulator.run(theirs, shots=1).result()
    found = [np.real(result.data(i)["density_matrix"].data[1, 1]) for i in range(len(theirs))]
    z = noisy_circuits(executable).expectation(executable.bind(np.array([[0.9]]), np.zeros(0)))
    np.testing.assert_allclose(found, (1 - z[0]) / 2, atol=1e-12)


@pytest.mark.parametrize(("name", "circuits"), [("fake_lima", 7), ("fake_toronto", 12)])
def test_rounds_and_wide_circuits(name: str, circuits: int) -> None:
    """Seven circuits on five qubits; twelve at once, too many for a density matrix."""
    executor = open_executor(f"qiskit:{name}", 6)
    executable = paper(circuits, device=executor.device)
    assert executable.round_count == (2 if name == "fake_lima" else 1)
    x, theta = inputs(4, circuits)
    ones = executor.run(executable, x, theta, 1000)
    assert not surprises(ones, 1000, p_one(executable, x, theta)).any()


def test_a_backend_without_properties_is_read_from_its_target() -> None:
    executor = PrimitiveExecutor(GenericBackendV2(3, seed=1), seed=7)
    executable, (x, theta) = paper(3, 1, executor.device), inputs(5, 3)
    ones = executor.run(executable, x, theta, 4000)
    assert not surprises(ones, 4000, p_one(executable, x, theta)).any()


def test_rounds_and_observations_are_drawn_independently() -> None:
    program = Program.of([Circuit.parse("ry(x0)")] * 10, 1)
    executable = compile(program, LIMA.device)
    ones = LIMA.run(executable, np.full((20, 1), 1.5), np.zeros(0), 2000)
    for qubit in range(5):
        first, second = ones[:, executable.qubits == qubit].T
        assert (first != second).any()
        assert len(set(first.tolist())) > 1


class Counting:
    """A sampler without noise that keeps the pubs of its jobs."""

    def __init__(self) -> None:
        self.jobs: list[list[tuple[QuantumCircuit, Any]]] = []
        options = {"backend_options": {"method": "matrix_product_state"}}
        self.sampler = AerSampler(seed=1, options=options)

    def run(self, pubs: list[tuple[QuantumCircuit, Any]], *, shots: int) -> Any:
        self.jobs.append(pubs)
        return self.sampler.run(pubs, shots=shots)


@pytest.mark.parametrize("name", ["fake_lima", "fake_toronto"])
def test_a_bit_is_its_circuit(name: str) -> None:
    """Twelve circuits, x or nothing, without noise: over three rounds, or over two bytes."""
    pattern = [1, 0, 0, 1, 1, 1, 0, 1, 0, 0, 0, 1]
    executor = PrimitiveExecutor(find_backend(name), sampler=Counting())
    circuits = [Circuit.parse("x" if bit else "") for bit in pattern]
    executable = compile(Program.of(circuits), executor.device)
    assert not executable.open_slots.size
    ones = executor.run(executable, np.zeros((3, 0)), np.zeros(0), 10)
    np.testing.assert_array_equal(ones, np.tile(np.multiply(10, pattern), (3, 1)))


def test_angles_may_be_open_in_some_rounds_only() -> None:
    executor = PrimitiveExecutor(find_backend("fake_lima"), sampler=Counting())
    circuits = [Circuit.parse("x"), Circuit.parse("ry(x0)"), Circuit(), Circuit.parse("ry(x1)")]
    executable = compile(Program.of(circuits, 2), executor.device)
    rounds = dataclasses.replace(executable, rounds=np.array([0, 1, 0, 2]))
    x = np.pi * np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    ones = executor.run(rounds, x, np.zeros(0), 10)
    assert ones.tolist() == [[10, 0, 0, 0], [10, 0, 0, 10], [10, 10, 0, 0], [10, 10, 0, 10]]


@pytest.mark.parametrize("level", [0, 2])
def test_a_call_is_one_job_with_a_pub_for_each_round(level: int) -> None:
    sampler = Counting()
    executor = PrimitiveExecutor(find_backend("FakeLimaV2"), sampler=sampler)
    executable, (x, theta) = paper(7, level, executor.device), inputs(9, 7)
    executor.run(executable, x, theta, 100)
    ones = executor.run(executable, x, theta, 1000)
    assert [len(pubs) for pubs in sampler.jobs] == [2, 2]
    assert all(a[0] is b[0] for a, b in zip(*sampler.jobs, strict=True)), "circuits are made once"
    assert [len(array) for _, values in sampler.jobs[0] for array in values.values()] == [9, 9]
    assert sum(c.num_parameters for c, _ in sampler.jobs[0]) == len(executable.open_slots)
    assert [c.num_clbits for c, _ in sampler.jobs[0]] == np.bincount(executable.rounds).tolist()
    p_true = (1 + np.sin(x) * np.cos(theta) + np.cos(x) ** 2 * np.sin(theta)) / 2
    assert not surprises(ones, 1000, p_true).any()


def runtime_sampler(backend: Any) -> Any:
    from qiskit_ibm_runtime import SamplerV2

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return SamplerV2(mode=backend)


def test_a_sampler_that_checks_the_gates_of_its_backend_takes_the_circuits() -> None:
    backend = find_backend("FakeLimaV2")
    executor = PrimitiveExecutor(backend, sampler=runtime_sampler(backend))
    executable = paper(7, 0)
    assert executor.run(executable, *inputs(2, 7), 20).shape == (2, 7)
    foreign = Program.of([Circuit.parse("h")] * 7)
    wrong = dataclasses.replace(executable, native=foreign)
    with pytest.raises(DeviceError, match=r"did not run the job\.\n  .*The instruction h on"):
        executor.run(wrong, *inputs(2, 7), 20)


def test_qiskit_s_own_primitive_works_too() -> None:
    executor = PrimitiveExecutor(find_backend("FakeLimaV2"), sampler=StatevectorSampler(seed=2))
    executable = compile(Program.of([Circuit.parse("ry(x0)")] * 2, 1), executor.device)
    x = np.array([[0.0], [np.pi]])
    assert executor.run(executable, x, np.zeros(0), 50).tolist() == [[0, 0], [50, 50]]


def test_the_same_seed_gives_the_same_ones_and_calls_differ() -> None:
    backend, (x, theta) = find_backend("FakeLimaV2"), inputs(3, 7)

    def run(seed: int) -> list[list[list[int]]]:
        executor = PrimitiveExecutor(backend, seed=seed)
        executable = paper(7, device=executor.device)
        return [executor.run(executable, x, theta, 500).tolist() for _ in range(2)]

    first, again, other = run(3), run(3), run(4)
    assert first == again
    assert first != other
    assert first[0] != first[1], "two calls drew the same noise"


def test_no_observations_and_no_circuits() -> None:
    x, theta = inputs(2, 7)
    assert LIMA.run(paper(7), x[:0], theta, 10).shape == (0, 7)
    empty = compile(Program.of([]), LIMA.device)
    assert LIMA.run(empty, np.zeros((2, 0)), np.zeros(0), 10).shape == (2, 0)


def test_the_device_is_the_calibration_of_the_backend() -> None:
    assert LIMA.kind == "noise-model"
    assert LIMA.device.name == "fake_lima"
    assert LIMA.device.qubits == load_device("fake_lima").qubits


class Wrapped:
    """A sampler of somebody's own, which says what it runs on."""

    def __init__(self, backend: Any):
        self.backend = backend


class OwnFake(type(find_backend("FakeLimaV2"))):  # type: ignore[misc]
    """A fake backend of one's own."""


def machine() -> Any:
    """IBM's class of a machine, without a connection: nothing but its type is asked."""
    from qiskit_ibm_runtime import IBMBackend

    return object.__new__(IBMBackend)


def samplers() -> dict[str, tuple[Any, str]]:
    fake = find_backend("FakeLimaV2")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {
            "none": (None, "noise-model"),
            "Qiskit's statevector": (StatevectorSampler(), "noise-model"),
            "Aer's": (AerSampler(), "noise-model"),
            "local testing mode": (runtime_sampler(fake), "noise-model"),
            "local testing mode, Aer": (runtime_sampler(AerSimulator()), "noise-model"),
            "over a fake": (BackendSamplerV2(backend=fake), "noise-model"),
            "over a fake of one's own": (BackendSamplerV2(backend=OwnFake()), "noise-model"),
            "over a generic backend": (Wrapped(GenericBackendV2(3)), "noise-model"),
            "a method": (Wrapped(lambda: fake), "noise-model"),
            "says nothing": (Counting(), "noise-model"),
            "over a machine": (Wrapped(machine()), "hardware"),
            "over a machine, a method": (Wrapped(machine), "hardware"),
            "over what is not known": (Wrapped(object()), "hardware"),
        }


@pytest.mark.parametrize("name", samplers())
def test_the_kind_is_that_of_the_sampler(name: str) -> None:
    """All are opened for a fake backend: what the sampler says of itself counts first."""
    sampler, kind = samplers()[name]
    assert PrimitiveExecutor(find_backend("FakeLimaV2"), sampler=sampler).kind == kind


def test_a_sampler_that_says_nothing_runs_on_the_backend_it_is_given_for() -> None:
    assert sampler_kind(Counting(), machine()) == "hardware"
    assert sampler_kind(None, machine()) == "noise-model"  # its calibration, played in Aer


def test_a_kind_that_is_given_counts() -> None:
    backend = find_backend("FakeLimaV2")
    sampler = Wrapped(object())
    assert PrimitiveExecutor(backend, sampler=sampler, kind="noise-model").kind == "noise-model"


def test_shots_are_not_spread_over_threads() -> None:
    """Aer draws other counts where they are; 1 is its word for never."""
    assert LIMA._simulator.options.max_parallel_shots == 1


def test_wrong_use_is_refused() -> None:
    executable, (x, theta) = paper(3), inputs(1, 3)
    with pytest.raises(CountsError, match="0 shots cannot be run"):
        LIMA.run(executable, x, theta, 0)
    with pytest.raises(CountsError, match=r"fake_lima runs through a sampler.*\n.*number of shots"):
        LIMA.expectation(executable, x, theta)
    with pytest.raises(CircuitError, match="The program needs"):
        LIMA.run(executable, x[:, :2], theta, 10)
    with pytest.raises(DeviceError, match="compiled for ibm_lima, this executor runs fake_lima"):
        LIMA.run(paper(3, device=load_device("ibm_lima")), x, theta, 10)


class Refusing:
    def run(self, pubs: Any, *, shots: int) -> Any:
        raise QiskitError("Too many shots for this machine.\nA stack of words follows.")


class Generous:
    def run(self, pubs: Any, *, shots: int) -> Any:
        return AerSampler(seed=1).run(pubs, shots=shots + 1)


def test_errors_of_a_sampler_are_explained() -> None:
    backend, (x, theta) = find_backend("FakeLimaV2"), inputs(2, 3)
    refused = PrimitiveExecutor(backend, sampler=Refusing())
    with pytest.raises(DeviceError) as found:
        refused.run(paper(3, device=refused.device), x, theta, 10)
    assert str(found.value) == (
        "The sampler of fake_lima did not run the job.\n"
        "  Too many shots for this machine.\n"
        "  The job had 1 circuits, 2 observations, 10 shots."
    )
    assert isinstance(found.value.__cause__, QiskitError)
    generous = PrimitiveExecutor(backend, sampler=Generous())
    with pytest.raises(DeviceError, match=r"gave bits of shape \(2, 11\)"):
        generous.run(paper(3, device=generous.device), x, theta, 10)


def test_missing_packages_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    backend = find_backend("FakeLimaV2")
    monkeypatch.setitem(sys.modules, "qiskit_aer", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'qcompile\[qiskit\]'"):
        PrimitiveExecutor(backend)


def test_a_backend_is_opened_by_name() -> None:
    found = open_executor("qiskit:FakeLimaV2", 1)
    assert isinstance(found, PrimitiveExecutor)
    assert found.device == LIMA.device
    for backend in ("fake_lima", load_device("fake_lima")):
        offline = open_executor(backend, 1)
        assert isinstance(offline, OfflineExecutor)
        assert offline.device == load_device("fake_lima")
    with pytest.raises(DeviceError, match=r"Unknown fake backend 'FakeLimaV3'\.\n.*FakeLimaV2"):
        open_executor("qiskit:FakeLimaV3")
    with pytest.raises(DeviceError, match="Unknown backend 'nosuch'"):
        open_executor("nosuch")
