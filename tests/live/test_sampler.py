"""GuardedSampler: any PUBs, with the same results as from IBM's own sampler."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.circuit import Parameter
from qiskit.primitives import BasePrimitiveJob, BaseSamplerV2, PrimitiveResult, SamplerPubResult
from standin import StandIn

from qcompile.errors import CountsError, LiveError, OptionError, QcompileError
from qcompile.live import GuardedSampler

from .sampled import VALUES, bits, by_ibm, flipped, two_registers


def test_a_result_is_that_of_ibms_own_sampler(service: StandIn) -> None:
    """The stand-in draws the same bits for the same PUBs: to the bit, shape by shape."""
    pubs = [(two_registers(), VALUES), flipped(), (two_registers(), VALUES[0, 0])]
    expected = by_ibm("fake_lima", pubs, 200)
    with GuardedSampler("fake_lima") as sampler:
        assert isinstance(sampler, BaseSamplerV2)
        job = sampler.run(pubs, shots=200)
        assert isinstance(job, BasePrimitiveJob)
        found = job.result()
    assert isinstance(found, PrimitiveResult)
    assert bits(found) == bits(expected)
    for pub, other in zip(found, expected, strict=True):
        assert isinstance(pub, SamplerPubResult)
        assert (list(pub.data), pub.data.shape) == (list(other.data), other.data.shape)
        for name in pub.data:
            ours, theirs = pub.data[name], other.data[name]
            assert (ours.shape, ours.num_shots) == (theirs.shape, theirs.num_shots)
            assert (ours.num_bits, ours.get_counts()) == (theirs.num_bits, theirs.get_counts())
        assert pub.metadata["circuit_metadata"] == other.metadata["circuit_metadata"]
    theirs, ours = service.ledger().jobs
    assert (ours.circuits, ours.shots) == (theirs.circuits, theirs.shots) == (8, 200)
    assert sampler.journal.folder.as_posix() == "runs/mine"


def test_shots_are_those_of_the_pub_then_of_the_call_then_ibms(service: StandIn) -> None:
    """IBM's sampler takes one number of shots per job, so different shots are different jobs."""
    pubs = [(flipped(0), None, 30), flipped(1), (flipped(2), None, 30), flipped(3)]
    with GuardedSampler("fake_lima") as sampler:
        found = sampler.run(pubs, shots=50).result()
        usual = sampler.run([flipped(4)]).result()
    assert [pub.data.meas.num_shots for pub in [*found, *usual]] == [30, 50, 30, 50, 4096]
    for qubit, pub in enumerate([*found, *usual]):
        likeliest, _ = max(pub.data.meas.get_int_counts().items(), key=lambda item: item[1])
        assert likeliest == 1 << qubit
    sent = [(job.circuits, job.shots) for job in service.ledger().jobs]
    assert sent == [(2, 30), (2, 50), (1, 4096)]


def test_a_call_above_the_limit_of_a_job_is_cut_unseen(
    service: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six rows and one more PUB, four rows to a job; their angles tell the rows apart."""
    monkeypatch.setattr("qcompile.execution.cost.MAX_EXECUTIONS_PER_JOB", 4000)
    angles = np.pi * np.array([[[1, 1], [1, 0], [0, 1]], [[0, 0], [1, 0], [0, 0]]])
    with GuardedSampler("fake_lima") as sampler:
        found = sampler.run([(two_registers(), angles), flipped()], shots=1000).result()
    assert [job.circuits for job in service.ledger().jobs] == [4, 3]
    left = found[0].data.left
    assert left.shape == (2, 3)
    share = left.bitcount().mean(axis=-1)  # sx rz(b) sx: b = 0 flips, b = pi does not
    np.testing.assert_allclose(share, (1 + np.cos(angles[..., 1])) / 2, atol=0.1)
    right = found[0].data.right.slice_bits([0]).bitcount().mean(axis=-1)
    np.testing.assert_allclose(right, (1 + np.cos(angles[..., 0])) / 2, atol=0.1)
    assert max(found[1].data.meas.get_int_counts()) >= 1 << 3


def test_rows_without_parameters_and_no_rows_at_all(service: StandIn) -> None:
    from qiskit.primitives.containers.bindings_array import BindingsArray

    several = (flipped(), BindingsArray({}, shape=(2, 2)))
    with GuardedSampler("fake_lima") as sampler:
        pubs = [several, (two_registers(), np.zeros((0, 2)))]
        found = sampler.run(pubs, shots=20).result()
        again = sampler.run([(two_registers(), np.zeros((0, 2)))]).result()
    assert found[0].data.meas.shape == (2, 2)
    assert found[1].data.left.shape == again[0].data.left.shape == (0,)
    assert [job.circuits for job in service.ledger().jobs] == [4]


@pytest.mark.parametrize("batch", [False, True])
def test_the_backend_object_of_the_user(service: StandIn, batch: bool) -> None:
    from qiskit_ibm_runtime import QiskitRuntimeService

    backend = QiskitRuntimeService().backend("fake_lima")
    with GuardedSampler(backend, batch=batch) as sampler:
        sampler.run([flipped()], shots=10).result()
    [job] = service.ledger().jobs
    assert (job.session_id is not None) is batch
    assert job.backend == "fake_lima"
    with GuardedSampler("fake_lima") as sampler:  # and by name it is the same
        sampler.run([flipped()], shots=10).result()
    assert len(service.ledger().jobs) == 1


def aer() -> Any:
    from qiskit_aer import AerSimulator

    return AerSimulator()


def fake() -> Any:
    from qiskit_ibm_runtime.fake_provider import FakeLimaV2

    return FakeLimaV2()


@pytest.mark.parametrize("make", [aer, fake, lambda: None, lambda: 3])
def test_what_is_no_machine_of_ibms_is_refused(service: StandIn, make: Callable[[], Any]) -> None:
    with pytest.raises(OptionError, match=r"It takes the name of a machine, or an IBMBackend"):
        GuardedSampler(make())
    assert not service.ledger().requests


def unmeasured() -> QuantumCircuit:
    return QuantumCircuit(2)


@pytest.mark.parametrize(
    ("pubs", "kind", "words"),
    [
        (flipped(), OptionError, "PUBs must be in a list"),
        (3, OptionError, "PUBs must be in a list"),
        ([], OptionError, "There is no PUB to run"),
        ([flipped(), "x"], OptionError, "PUB 1 is not valid"),
        ([flipped(), two_registers()], OptionError, "PUB 1 is not valid: The number of values"),
        ([(two_registers(), VALUES[0] * np.nan)], OptionError, "one of its values is not finite"),
        ([{"circuit": flipped()}], OptionError, "PUB 0 is not valid"),
        ([(flipped(), None, 0)], OptionError, "shots must be positive"),
        ([(flipped(), None, 20_000_000)], CountsError, "20000000 shots cannot be run"),
        ([unmeasured()], OptionError, "PUB 0 measures nothing"),
    ],
)
def test_what_is_not_a_pub_is_refused_and_takes_no_place(
    service: StandIn, pubs: Any, kind: type[QcompileError], words: str
) -> None:
    with GuardedSampler("fake_lima") as sampler:
        with pytest.raises(kind, match=words):
            sampler.run(pubs)
        assert sampler.journal.submissions() == []
        sampler.run([flipped()], shots=10).result()
    assert len(service.ledger().jobs) == 1


def entangled() -> QuantumCircuit:
    made = QuantumCircuit(2)
    made.swap(0, 1)
    made.measure_all()
    return made


def branching() -> QuantumCircuit:
    made = QuantumCircuit(2, 1)
    made.measure(0, 0)
    with made.if_test((made.clbits[0], 1)):
        made.h(1)
    return made


@pytest.mark.parametrize(
    ("circuit", "words"),
    [
        (entangled(), r"Its swap on qubits \(0, 1\) is not an instruction"),
        (branching(), "Its h on qubit 1 is not an instruction"),
        (QuantumCircuit(6, 1), "It has 6 qubits; the machine has 5"),
    ],
)
def test_a_circuit_that_the_machine_cannot_run_is_not_sent(
    service: StandIn, circuit: QuantumCircuit, words: str
) -> None:
    """Nothing is in doubt, and the position is free for the circuit once it is compiled."""
    with GuardedSampler("fake_lima") as sampler:
        with pytest.raises(LiveError, match=words):
            sampler.run([circuit], shots=10)
        assert sampler.costs["qpu_seconds"] == 0
        sampler.run([flipped()], shots=10).result()
    assert len(service.ledger().jobs) == 1


def test_two_calls_are_sent_before_either_is_waited_for(service: StandIn) -> None:
    """The same PUBs twice are two samples."""
    service.settings.run_seconds = 0.2
    with GuardedSampler("fake_lima") as sampler:
        jobs = [sampler.run([flipped()], shots=500 + k) for k in (0, 0, 1)]
        assert len(service.ledger().jobs) == 3
        assert [job.status() for job in jobs] == ["RUNNING"] * 3
        assert (jobs[0].running(), jobs[0].in_final_state()) == (True, False)
        shots = [job.result()[0].data.meas.num_shots for job in reversed(jobs)]
        assert shots == [501, 500, 500]
        assert [job.status() for job in jobs] == ["DONE"] * 3
        assert (jobs[0].done(), jobs[0].cancelled()) == (True, False)
        ids = [job_id for job in jobs for job_id in job.job_ids()]
        with pytest.raises(LiveError, match=f"IBM's own tools can cancel it: {ids[0]}"):
            jobs[0].cancel()
    assert ids == [job.id for job in service.ledger().jobs]
    assert len({job.job_id() for job in jobs}) == 3


def test_parameters_may_be_named_in_any_way(service: StandIn) -> None:
    """By object and by name, in one array or in several."""
    made = two_registers()
    names = {parameter.name: parameter for parameter in made.parameters}
    ways: list[Any] = [
        VALUES,
        {"b": VALUES[..., 1], "a": VALUES[..., 0]},
        {(names["b"], names["a"]): VALUES[..., ::-1]},
    ]
    with GuardedSampler("fake_lima") as sampler:
        found = [bits(sampler.run([(made, way)], shots=100).result()) for way in ways]
    assert found[0] == found[1] == found[2]


def test_an_unknown_parameter_is_refused(service: StandIn) -> None:
    with (
        GuardedSampler("fake_lima") as sampler,
        pytest.raises(OptionError, match="PUB 0 is not valid: Could not find placement"),
    ):
        sampler.run([(two_registers(), {Parameter("z"): [1.0], Parameter("y"): [1.0]})])
