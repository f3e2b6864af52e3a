"""Circuits of several qubits through Qiskit samplers: Aer's noise, the order of bits, rounds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from live_runs import surprises
from qiskit.quantum_info import SparsePauliOp, Statevector
from qiskit_aer.primitives import SamplerV2 as AerSampler
from wide_aer import by_aer, noisy_simulator

import qcompile
from qcompile.errors import CircuitError
from qcompile.execution import OfflineExecutor, PrimitiveExecutor, open_executor
from qcompile.execution.packed import pack_round
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable
from qcompile.policy.layouts import parallel
from qcompile.snapshot import find_backend

LAYER = [["ry", "x0", 0], ["ry", "x1", 1], ["rx", "x0", 2], ["cz", 0, 1], ["cz", 1, 2]]
BLOCK = Circuit.of([*LAYER, ["ry", "theta0", 0], ["rz", "theta1", 1], ["ry", 0.3, 2], *LAYER], 3)
OBSERVABLES = ((0,), (0, 1), (1, 2), (0, 1, 2), (3,))
X = np.random.default_rng(5).uniform(-2, 2, (7, 2))
THETA = np.array([0.4, -1.3])
RING = [["cz", 0, 1], ["cz", 1, 2], ["cz", 2, 0]]
TURNED = [["ry", "x0", 0], ["rx", "x1", 1], ["ry", "theta0", 2]]
PRODUCTS = ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2))


def program() -> Program:
    """A circuit on three qubits beside one on a single qubit."""
    circuits = [BLOCK, Circuit.parse("h ry(x1)")]
    return replace(Program.of(circuits, 2, 2), observables=OBSERVABLES)


def executor(name: str = "FakeLimaV2", seed: int = 5) -> PrimitiveExecutor:
    found = open_executor(f"qiskit:{name}", seed)
    assert isinstance(found, PrimitiveExecutor)
    return found


def noiseless() -> AerSampler:
    options = {"backend_options": {"method": "matrix_product_state"}}
    return AerSampler(seed=1, options=options)


@pytest.mark.parametrize("gates", [LAYER * 6, [*TURNED, *RING, *TURNED, *RING, *TURNED]])
@pytest.mark.parametrize("name", ["FakeLimaV2", "FakeJakartaV2"])
def test_counts_follow_aers_density_matrix(name: str, gates: list[Any]) -> None:
    """Every product of Z, with the noise of couplings; the ring needs swaps on both devices."""
    sampler, shots = executor(name), 20_000
    wide = replace(Program.of([Circuit.of(gates, 3)], 2, 2), observables=PRODUCTS)
    executable = qcompile.compile(wide, sampler.device)
    simulator = noisy_simulator(name)
    exact = np.array([by_aer(executable, x, THETA, simulator) for x in X])
    odd = sampler.run(executable, X, THETA, shots)
    assert odd.dtype == np.int64
    assert not surprises(odd, shots, (1 - exact) / 2).any()
    assert surprises(odd, shots, (1 - without_coupling_errors(executable)) / 2).any()


def without_coupling_errors(executable: Executable) -> np.ndarray:
    """<O> with the noise of gates and readout only."""
    device = executable.device
    couplings = [{**each.model_dump(), "error": 0, "length_ns": 0} for each in device.couplings]
    quiet = qcompile.Device.model_validate(device.model_dump() | {"couplings": couplings})
    return OfflineExecutor(quiet).expectation(replace(executable, device=quiet), X, THETA)


def test_a_wide_circuit_beside_others_in_several_rounds() -> None:
    """Two wide circuits and one of a qubit do not fit on five qubits at once."""
    sampler, shots = executor(), 4000
    circuits = [BLOCK, Circuit.parse("ry(x1) rz(theta0) ry(x0)"), BLOCK]
    wide = replace(Program.of(circuits, 2, 2), observables=((4, 6), (3,), (0, 1, 2), (0,), (5,)))
    executable = qcompile.compile(wide, sampler.device)
    assert executable.round_count == 2
    odd = sampler.run(executable, X, THETA, shots)
    exact = OfflineExecutor(sampler.device).expectation(executable, X, THETA)
    assert not surprises(odd, shots, (1 - exact) / 2).any()


def pattern() -> Program:
    """Nine bits in four circuits, each 0 or 1, and observables in any order."""
    circuits = [
        Circuit.parse("x@0 cx@0,1 x@1 x@2", 3),  # 1 0 1
        Circuit.parse("x"),  # 1
        Circuit.parse("x@1 cx@1,0", 2),  # 1 1
        Circuit.parse("x@0 cx@2,1", 3),  # 1 0 0
    ]
    observables = ((8,), (0, 1), (4, 5), (2, 0, 1), (6, 7, 8), (3,), (7,))
    return replace(Program.of(circuits), observables=observables)


def test_bits_are_those_of_the_program_in_order() -> None:
    """Over two bytes on a machine that holds them at once, and over rounds on one that does not."""
    for name, rounds in (("FakeTorontoV2", 1), ("FakeLimaV2", 2)):
        sampler = PrimitiveExecutor(find_backend(name), sampler=noiseless())
        executable = qcompile.compile(pattern(), sampler.device)
        assert executable.round_count >= rounds
        shown = {}
        for index in range(executable.round_count):
            packed = pack_round(executable, index)
            assert packed.circuit.metadata["bits"] == packed.bits.tolist()
            assert packed.circuit.metadata["circuits"] == packed.circuits.tolist()
            [bitstring] = shown_by(packed.circuit)
            shown |= dict(zip(packed.bits.tolist(), bitstring[::-1], strict=True))
        assert "".join(shown[bit] for bit in range(9)) == "101111100"
        odd = sampler.run(executable, np.zeros((2, 0)), np.zeros(0), 10)
        assert odd.tolist() == [[0, 10, 0, 0, 10, 10, 0]] * 2


def shown_by(circuit: Any) -> list[str]:
    """The bit strings of register c without noise."""
    fixed = circuit.assign_parameters(dict.fromkeys(circuit.parameters, 0.0))
    return [*noiseless().run([fixed], shots=5).result()[0].data.c.get_counts()]


def test_the_counted_shots_are_those_of_the_observables_circuit() -> None:
    sampler = PrimitiveExecutor(find_backend("FakeTorontoV2"), sampler=noiseless())
    executable = qcompile.compile(pattern(), sampler.device)
    prepared = sampler.prepare(executable)
    odd = prepared.ones(np.zeros((1, 0)), np.zeros(0), np.array([3, 5, 7, 9]))
    assert odd.tolist() == [[0, 3, 0, 0, 9, 5, 0]]


def test_qubits_gained_by_routing_are_not_measured() -> None:
    """A flip comes from a third qubit, which stays in no observable and no register."""
    sampler = PrimitiveExecutor(find_backend("FakeLimaV2"), sampler=noiseless())
    source = replace(
        Program.of([Circuit.parse("x@0 cx@0,1", 2), Circuit()]), observables=((0,), (1,), (2,))
    )
    moved = Program.of([Circuit.parse("x@2 cx@2,0 cx@0,2 cx@0,1", 3), Circuit()])
    executable = Executable(
        source, moved, sampler.device, 1, np.array([1, 2, 0, 4]), np.zeros(2, dtype=np.intp)
    )
    packed = pack_round(executable, 0)
    measured = [
        packed.circuit.find_bit(instruction.qubits[0]).index
        for instruction in packed.circuit.data
        if instruction.operation.name == "measure"
    ]
    assert measured == [1, 2, 4]
    assert packed.qubits == 4
    assert packed.couplings == {("cx", 0, 1), ("cx", 1, 0), ("cx", 1, 2)}
    assert sampler.run(executable, np.zeros((1, 0)), np.zeros(0), 9).tolist() == [[9, 9, 0]]


def test_only_observables_in_another_order() -> None:
    """Circuits of one qubit, with no key "bits" in their metadata."""
    sampler = PrimitiveExecutor(find_backend("FakeLimaV2"), sampler=noiseless())
    flipped = Program.of([Circuit.parse("x"), Circuit(), Circuit.parse("x")])
    executable = qcompile.compile(replace(flipped, observables=((1,), (2,))), sampler.device)
    assert sampler.run(executable, np.zeros((1, 0)), np.zeros(0), 9).tolist() == [[0, 9]]
    assert pack_round(executable, 0).circuit.metadata == {"circuits": [0, 1, 2]}


@pytest.mark.parametrize("level", [0, 1, 2])
@pytest.mark.parametrize("device", ["fake_jakarta", "ideal"])
def test_qiskit_circuits_have_the_same_expectations(device: str, level: int) -> None:
    executable = qcompile.compile(program(), qcompile.load_device(device), level)
    (bound,) = executable.to_qiskit(X[0], THETA, measure=False)
    state = Statevector(bound)
    found = [
        state.expectation_value(SparsePauliOp("Z" * len(bits)), [*executable.bit_qubits[[*bits]]])
        for bits in OBSERVABLES
    ]
    ideal = qcompile.compile(program(), qcompile.load_device("ideal"))
    wanted = OfflineExecutor(ideal.device).expectation(ideal, X[:1], THETA)[0]
    np.testing.assert_allclose(np.real(found), wanted, atol=1e-9)
    (template,) = executable.to_qiskit()
    assert template.num_clbits == 4
    names = executable.template().inputs
    assert {parameter.name for parameter in template.parameters} == set(names)
    if device == "ideal":
        assert template.num_qubits == 4


def test_many_copies_are_simulated_in_small_rounds() -> None:
    """Three copies of four qubits are two circuits for Aer's density matrix, with equal counts."""
    sampler, shots = executor("FakeTorontoV2"), 1000
    executable = qcompile.compile(program(), sampler.device, copies=3)
    assert (executable.round_count, len(set(executable.qubits.tolist()))) == (1, 12)
    prepared: Any = sampler.prepare(executable)
    assert [packed.qubits for packed in prepared.rounds] == [8, 4]
    x = np.concatenate([X[:3], X[3:6], X[4:7]], axis=1)
    odd = prepared.ones(x, THETA, shots)
    exact = OfflineExecutor(sampler.device).expectation(executable, x, THETA)
    assert not surprises(odd, shots, (1 - exact) / 2).any()
    user = PrimitiveExecutor(sampler.device, sampler=noiseless(), kind="noise-model")
    as_packed: Any = user.prepare(executable)
    assert [packed.qubits for packed in as_packed.rounds] == [12]


def test_circuits_without_couplings_keep_their_simulator() -> None:
    sampler, narrow = executor(seed=1), executor(seed=1)
    of_one = qcompile.compile(parallel(3, 1)[0], sampler.device)
    x, theta = np.ones((2, 3)), np.zeros(3)
    wide = qcompile.compile(program(), sampler.device)
    sampler.run(wide, X, THETA, 10)
    sampler.rng = np.random.default_rng(1)
    found = sampler.run(of_one, x, theta, 500)
    np.testing.assert_array_equal(found, narrow.run(of_one, x, theta, 500))


def test_no_observations() -> None:
    executable = qcompile.compile(program(), executor().device)
    assert executor().run(executable, X[:0], THETA, 10).shape == (0, len(OBSERVABLES))


def test_a_twin_refuses_by_name() -> None:
    device = qcompile.load_device("fake_lima")
    known = qcompile.calibrate("fake_lima", seed=0, progress=False)
    twin = qcompile.execution.TwinExecutor(known)
    executable = qcompile.compile(program(), twin.device)
    with pytest.raises(CircuitError, match=r"A twin needs .* circuit 0 has 3.\n.*noise model"):
        twin.prepare(executable)
    assert device.couplings
