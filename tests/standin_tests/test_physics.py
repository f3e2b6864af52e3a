"""Counts follow the machine's noise, are the same when repeated, and keep their bits in order."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from qiskit import ClassicalRegister, QuantumCircuit, QuantumRegister
from qiskit.circuit import Parameter, ParameterVector
from qiskit_aer import AerSimulator
from qiskit_aer.noise import NoiseModel
from qiskit_ibm_runtime import QiskitRuntimeService
from qiskit_ibm_runtime.executor_sampler import Sampler
from qiskit_ibm_runtime.fake_provider import FakeLimaV2
from scipy.stats import binom
from standin import StandIn
from standin.physics import RefusedError, plan

SHOTS = 20_000
FALSE_ALARMS = 1e-7
"""Of each statistical test here."""


def is_surprising(ones: int, p_one: float, trials: int) -> bool:
    low, high = binom.interval(1 - FALSE_ALARMS / trials, SHOTS, p_one)
    return not low <= ones <= high


@cache
def aer() -> AerSimulator:
    noise = NoiseModel.from_backend_properties(FakeLimaV2().properties(), dt=2e-9 / 9)
    return AerSimulator(method="density_matrix", noise_model=noise)


def aer_p_one(circuit: QuantumCircuit) -> list[float]:
    """P(1) of each qubit: Aer's density matrix with the noise of the properties, then readout."""
    copy = circuit.remove_final_measurements(inplace=False)
    for qubit in range(circuit.num_qubits):
        copy.save_probabilities([qubit], label=str(qubit))
    data = aer().run(copy).result().data()
    result = []
    for qubit, values in enumerate(FakeLimaV2().properties().qubits):
        found = {v.name: v.value for v in values}
        zero, one = data[str(qubit)]
        result.append(one * (1 - found["prob_meas0_prep1"]) + zero * found["prob_meas1_prep0"])
    return result


def test_counts_follow_aers_density_matrix(backend: Any, make_sampler: Any) -> None:
    a, b = Parameter("a"), Parameter("b")
    circuit = QuantumCircuit(QuantumRegister(5, "q"), ClassicalRegister(5, "seen"))
    for qubit in range(5):
        for angle in (a, 2 * b - a + 0.3, a.sin() + qubit):
            circuit.sx(qubit)
            circuit.rz(angle, qubit)
            circuit.x(qubit)
        circuit.sx(qubit)
        circuit.measure(qubit, 4 - qubit)
    values = np.random.default_rng(2).uniform(-3, 3, (2, 3, 2))
    job = make_sampler(backend).run([(circuit, values)], shots=SHOTS)
    seen = job.result()[0].data.seen
    assert seen.shape == (2, 3)
    for index in np.ndindex(2, 3):
        for qubit, p_one in enumerate(aer_p_one(circuit.assign_parameters(values[index]))):
            ones = seen[index].slice_bits(4 - qubit).bitcount().sum()
            assert not is_surprising(int(ones), p_one, 60)


def test_bits_of_many_registers_and_pubs(backend: Any, make_sampler: Any) -> None:
    angle = ParameterVector("t", 1)
    first = QuantumCircuit(
        QuantumRegister(3), ClassicalRegister(2, "low"), ClassicalRegister(9, "x_1")
    )
    first.x(1)
    first.reset(1)
    first.x(2)
    first.measure([1, 2], [0, 10])
    second = QuantumCircuit(QuantumRegister(2), ClassicalRegister(1, "low"))
    second.sx(0)
    second.rz(angle[0], 0)
    second.sx(0)
    second.barrier()
    second.measure(0, 0)
    result = make_sampler(backend).run([first, (second, [[0.0], [np.pi]])], shots=1000).result()
    assert (result[0].data.low.num_bits, result[0].data.x_1.num_bits) == (2, 9)
    assert result[0].data.shape == ()
    assert max(result[0].data.low.get_counts().items(), key=lambda c: c[1])[0] == "00"
    assert max(result[0].data.x_1.get_counts().items(), key=lambda c: c[1])[0] == "1" + "0" * 8
    ones = result[1].data.low.bitcount().mean(axis=1)
    assert ones[0] > 0.85 > 0.15 > ones[1]


def test_fractional_gates(monkeypatch: pytest.MonkeyPatch) -> None:
    with StandIn({"fake_fractional": "FakeFractionalBackend"}) as stand_in:
        for name, value in stand_in.environment().items():
            monkeypatch.setenv(name, value)
        backend = QiskitRuntimeService().backend("fake_fractional", use_fractional_gates=True)
        angle = Parameter("a")
        circuit = QuantumCircuit(1, 1)
        circuit.rx(angle, 0)
        circuit.measure(0, 0)
        turns = np.array([[0.0], [np.pi / 2], [np.pi]])
        c = Sampler(backend).run([(circuit, turns)], shots=1000).result()[0].data.c
        np.testing.assert_allclose(c.bitcount().mean(axis=1), [0, 0.5, 1], atol=0.15)


def test_the_same_work_gives_the_same_counts(backend: Any, make_sampler: Any) -> None:
    a = Parameter("a")
    circuit = QuantumCircuit(2, 2)
    circuit.sx(0)
    circuit.rz(a, 0)
    circuit.sx(0)
    circuit.measure([0, 1], [0, 1])
    renamed = circuit.assign_parameters({a: Parameter("other")})
    bound = circuit.assign_parameters([0.7])
    sampler = make_sampler(backend, environment={"job_tags": ["first"]})
    first = sampler.run([(circuit, [0.7])], shots=200).result()[0].data.c
    again = make_sampler(backend).run([(renamed, [0.7])], shots=200).result()[0].data.c
    fixed = make_sampler(backend).run([bound], shots=200).result()[0].data.c
    other = make_sampler(backend).run([(circuit, [0.71])], shots=200).result()[0].data.c
    assert first == again == fixed
    assert first != other


def test_entangled_qubits_agree_but_for_their_readout(backend: Any, make_sampler: Any) -> None:
    a = Parameter("a")
    circuit = QuantumCircuit(
        QuantumRegister(5, "q"), ClassicalRegister(1, "first"), ClassicalRegister(2, "others")
    )
    circuit.sx(0)
    circuit.rz(a, 0)
    circuit.sx(0)  # P(1) = cos(a / 2)^2
    circuit.cx(0, 1)
    circuit.cx(1, 2)
    circuit.measure([0, 1, 2], [0, 1, 2])
    values = np.array([0.0, np.pi / 2, np.pi])
    if make_sampler.program == "executor":
        values = values[:, np.newaxis]
    data = make_sampler(backend).run([(circuit, values)], shots=4000).result()[0].data
    first = data.first.to_bool_array(order="little")[..., 0]
    others = data.others.to_bool_array(order="little")
    assert first.shape == (3, 4000)
    assert others.shape == (3, 4000, 2)
    assert first.mean(axis=1) == pytest.approx([1, 0.5, 0], abs=0.08)
    agree = (first == others[..., 0]) & (first == others[..., 1])
    assert agree.mean() > 0.85  # the readout errors of three qubits of this machine
    assert not agree.all()


def test_many_entangled_qubits_are_refused() -> None:
    circuit = QuantumCircuit(27)
    for qubit in range(20):
        circuit.cx(qubit, qubit + 1)
    with pytest.raises(RefusedError, match="entangles 12 qubits at most, not 21"):
        plan(circuit, ("cx",), 27)
