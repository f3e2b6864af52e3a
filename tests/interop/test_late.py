"""Late binding of Qiskit circuits, against Qiskit's own statevectors, operators and primitives."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.circuit import Parameter, ParameterExpression, ParameterVector
from qiskit.circuit.library import efficient_su2
from qiskit.primitives import StatevectorEstimator, StatevectorSampler
from qiskit.primitives.containers import EstimatorPub, SamplerPub
from qiskit.quantum_info import SparsePauliOp, Statevector
from qiskit.transpiler import generate_preset_pass_manager
from qiskit_aer import AerSimulator
from qiskit_ibm_runtime.fake_provider import FakeFractionalBackend, FakeLimaV2, FakeTorino

import qcompile

FIXED = ("h", "x", "y", "z", "s", "sdg", "t", "tdg", "sx", "sxdg", "id")
ROTATIONS = ("rx", "ry", "rz", "p")
TWO = ("cx", "cz", "ecr", "swap", "iswap", "ch", "dcx")
TWO_ANGLED = ("rzz", "rxx", "cp", "crx", "crz")


def transpiled(circuit: QuantumCircuit, backend: Any, level: int = 1) -> QuantumCircuit:
    return generate_preset_pass_manager(level, backend, seed_transpiler=0).run(circuit)


def expression(rng: np.random.Generator, parameters: list[Parameter]) -> ParameterExpression:
    """An angle that is affine, a product, a function, or out of the usual range."""
    a, b = rng.choice(len(parameters), 2)
    first, second = parameters[a], parameters[b]
    return [
        lambda: first,
        lambda: 2 * first - second + math.pi,
        lambda: (math.pi - first) * (math.pi - second),
        lambda: first.sin() + second**2,
        lambda: 100 * first,
        lambda: first - first + 0.5,
    ][rng.integers(6)]()


def random_circuit(rng: np.random.Generator, qubits: int) -> QuantumCircuit:
    parameters = [*ParameterVector("v", 11), Parameter("β")]
    circuit = QuantumCircuit(qubits, global_phase=parameters[0])
    for _ in range(12 * qubits):
        kind = rng.random()
        qubit, other = rng.choice(max(qubits, 2), 2, replace=False).tolist()
        angle = expression(rng, parameters) if rng.random() < 0.7 else float(rng.uniform(-9, 9))
        if qubits == 1 or kind < 0.6:
            qubit = min(qubit, qubits - 1)
            if rng.random() < 0.5:
                getattr(circuit, str(rng.choice(FIXED)))(qubit)
            elif rng.random() < 0.1:
                circuit.u(angle, 0.3, parameters[2], qubit)
            else:
                getattr(circuit, str(rng.choice(ROTATIONS)))(angle, qubit)
        elif kind < 0.8:
            getattr(circuit, str(rng.choice(TWO)))(qubit, other)
        elif kind < 0.95:
            getattr(circuit, str(rng.choice(TWO_ANGLED)))(angle, qubit, other)
        elif kind < 0.97:
            circuit.barrier(qubit)
        else:
            inner = QuantumCircuit(1, name="mine")
            inner.rx(angle, 0)
            inner.append(QuantumCircuit(1).to_gate(), [0])
            circuit.append(inner.to_gate(), [qubit])
    return circuit


@pytest.mark.parametrize("seed", range(40))
def test_state_and_distribution_are_kept_for_any_circuit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    circuit = random_circuit(rng, int(rng.integers(1, 5)))
    values = rng.uniform(-5, 5, (3, len(circuit.parameters)))
    for keep in ("state", "z"):
        bound = qcompile.qiskit.late(circuit, keep=keep)
        angles = bound.angles(values)
        for row, of_template in zip(values, angles, strict=True):
            expected = Statevector(circuit.assign_parameters(row))
            template = bound.circuit.assign_parameters(of_template)
            found = Statevector(template)
            if keep == "state":
                assert abs(abs(expected.inner(found)) - 1) < 1e-10
            np.testing.assert_allclose(found.probabilities(), expected.probabilities(), atol=1e-10)
            for instruction in template.get_instructions("rzz"):
                assert 0 <= float(instruction.params[0]) <= math.pi / 2


def skolik() -> QuantumCircuit:
    """Four qubits, three layers, inputs in each."""
    x, theta = ParameterVector("x", 4), iter(ParameterVector("t", 24))
    circuit = QuantumCircuit(4)
    for _ in range(3):
        for qubit in range(4):
            circuit.rx(x[qubit], qubit)
            circuit.ry(next(theta), qubit)
            circuit.rz(next(theta), qubit)
        for qubit in range(4):
            circuit.cz(qubit, (qubit + 1) % 4)
    return circuit


def test_runs_have_two_pulses_and_the_couplings_stay() -> None:
    isa = transpiled(skolik(), FakeLimaV2(), 3)
    before, after = isa.count_ops(), qcompile.qiskit.late(isa).circuit.count_ops()
    assert after["cx"] == before["cx"]
    assert after["sx"] < 0.8 * before["sx"]
    runs = 0  # the stretches of gates on a qubit between two cx
    for qubit in isa.qubits:
        sequence = ["|" if len(i.qubits) == 2 else "g" for i in isa.data if qubit in i.qubits]
        runs += sum(bool(part) for part in "".join(sequence).split("|"))
    assert after["sx"] <= 2 * runs


def test_fractional_gates_need_one_pulse_a_run() -> None:
    backend = FakeFractionalBackend()
    isa = transpiled(efficient_su2(4, reps=2), backend)
    bound = qcompile.qiskit.late(isa, backend)
    counts = bound.circuit.count_ops()
    assert set(counts) == {"rz", "rx", "cx"}
    assert counts["cx"] == isa.count_ops()["cx"]
    assert counts["rx"] == 12  # three layers of four runs


def test_open_angles_of_rzz_are_folded() -> None:
    circuit = QuantumCircuit(3)
    beta, gamma = ParameterVector("b", 2), ParameterVector("g", 2)
    circuit.h(range(3))
    for layer in range(2):
        circuit.rzz(2 * gamma[layer], 0, 1)
        circuit.rzz(4 * gamma[layer] - 1, 1, 2)
        circuit.rx(2 * beta[layer], range(3))
    bound = qcompile.qiskit.late(circuit)
    values = np.random.default_rng(0).uniform(-9, 9, (50, 4))
    for row, angles in zip(values, bound.angles(values), strict=True):
        template = bound.circuit.assign_parameters(angles)
        inside = [float(i.params[0]) for i in template.get_instructions("rzz")]
        assert len(inside) == 4
        assert 0 <= min(inside) <= max(inside) <= math.pi / 2
        expected = Statevector(circuit.assign_parameters(row))
        assert abs(abs(expected.inner(Statevector(template))) - 1) < 1e-10


def test_angles_take_what_qiskit_takes() -> None:
    circuit = QuantumCircuit(1)
    vector, single = ParameterVector("v", 12), Parameter("a")
    for parameter in [*vector, single]:
        circuit.rx(parameter, 0)
        circuit.rz(0.3, 0)
    bound = qcompile.qiskit.late(circuit)
    values = np.random.default_rng(1).uniform(-3, 3, (2, 5, 13))
    order = [p.name for p in circuit.parameters]
    assert order.index("v[2]") < order.index("v[10]")  # Qiskit's order, not the alphabet's
    first = order.index("v[0]")
    mapping = {vector: values[..., first : first + 12], "a": values[..., order.index("a")]}
    np.testing.assert_array_equal(bound.angles(mapping), bound.angles(values))
    assert bound.angles(values).shape == (2, 5, len(bound.circuit.parameters))
    np.testing.assert_allclose(bound.angles(values)[1, 3], bound.angles(values[1, 3]), atol=1e-13)
    assert bound.angles(np.zeros((0, 13))).shape == (0, len(bound.circuit.parameters))


def test_pubs_give_the_samplers_counts_and_the_estimators_values() -> None:
    circuit = transpiled(skolik(), FakeLimaV2())
    values = np.random.default_rng(2).uniform(-3, 3, (2, 3, len(circuit.parameters)))
    observables = [[SparsePauliOp("XXIZ"), "ZZZZ", {"YIII": 0.5, "IIIX": -1.0}]]
    bound = qcompile.qiskit.late(circuit)
    mapped = bound.map_observables(observables)
    pub = bound.pub((circuit, mapped, values, 0.0))
    assert isinstance(pub, EstimatorPub)
    assert pub.circuit is bound.circuit
    estimator = StatevectorEstimator()
    expected = estimator.run([(circuit, mapped, values)]).result()[0].data.evs
    found = estimator.run([pub]).result()[0].data.evs
    np.testing.assert_allclose(found, expected, atol=1e-9)

    circuit.measure_active()
    z = qcompile.qiskit.late(circuit, keep="z")
    sampled = z.pub((circuit, values, 5))
    assert isinstance(sampled, SamplerPub)
    assert (sampled.shots, sampled.shape) == (5, (2, 3))
    result = StatevectorSampler(seed=0).run([z.pub((circuit, values[0], 20000))]).result()[0]
    counts = result.join_data()
    for i, row in enumerate(values[0]):
        state = Statevector(circuit.assign_parameters(row).remove_final_measurements(inplace=False))
        p = state.probabilities()
        for outcome, ones in counts.get_int_counts(i).items():
            assert abs(ones - 20000 * p[outcome]) < 6 * math.sqrt(20000 * p[outcome]) + 1


def test_the_layout_and_the_registers_stay() -> None:
    circuit = skolik()
    circuit.measure_all()
    isa = transpiled(circuit, FakeTorino())
    bound = qcompile.qiskit.late(isa, FakeTorino())
    assert bound.circuit.layout is not None
    before, after = isa.layout.final_index_layout(), bound.circuit.layout.final_index_layout()
    assert after == before
    assert bound.circuit.cregs == isa.cregs
    assert bound.circuit.num_qubits == 133
    measured = [(i.qubits, i.clbits) for i in isa.get_instructions("measure")]
    assert [(i.qubits, i.clbits) for i in bound.circuit.get_instructions("measure")] == measured
    op = SparsePauliOp(["ZIII", "IXII"])
    assert bound.map_observables(op) == op.apply_layout(isa.layout)
    assert not isinstance(bound.circuit.global_phase, ParameterExpression)


def dynamic() -> QuantumCircuit:
    """A measurement in the middle, a branch with an open angle, a reset and a delay."""
    a, b = Parameter("a"), Parameter("b")
    circuit = QuantumCircuit(2, 3)
    circuit.ry(a, 0)
    circuit.rz(b, 0)
    circuit.cx(0, 1)
    circuit.rz(a * b, 0)
    circuit.measure(0, 0)
    with circuit.if_test((circuit.clbits[0], 1)):
        circuit.rx(2 * b, 1)
        circuit.h(0)
    circuit.rx(a, 1)
    circuit.ry(b, 1)
    circuit.delay(100, 1)
    circuit.measure(1, 1)
    circuit.reset(1)
    circuit.h(1)
    circuit.rz(b, 1)
    circuit.ry(a, 1)
    circuit.cz(0, 1)
    circuit.ry(0.4, 0)
    circuit.rz(b, 0)
    circuit.measure(1, 2)
    circuit.measure(0, 0)
    return circuit


def test_measurements_branches_and_resets_stay_in_their_places() -> None:
    circuit = dynamic()
    bound = qcompile.qiskit.late(circuit)
    assert [i.operation.name for i in bound.circuit.data if i.clbits] == [
        *("measure", "if_else", "measure", "measure", "measure")
    ]
    last = {
        q: [i.operation.name for i in bound.circuit.data if q in i.qubits][-1]
        for q in bound.circuit.qubits
    }
    assert set(last.values()) == {"measure"}
    simulator, shots = AerSimulator(seed_simulator=5), 8_000
    values = np.array([[0.7, -1.9], [2.2, 0.4]])
    for row, angles in zip(values, bound.angles(values), strict=True):
        pair = [circuit.assign_parameters(row), bound.circuit.assign_parameters(angles)]
        left, right = (simulator.run(c, shots=shots).result().get_counts() for c in pair)
        for outcome in {*left, *right}:
            ours, theirs = left.get(outcome, 0), right.get(outcome, 0)
            assert abs(ours - theirs) < 6 * math.sqrt(ours + theirs)


def test_circuits_without_parameters_or_angles() -> None:
    fixed = QuantumCircuit(2)
    fixed.h(0)
    fixed.t(0)
    fixed.h(0)
    fixed.cx(0, 1)
    bound = qcompile.qiskit.late(fixed)
    assert bound.angles(np.zeros((4, 0))).shape == (4, 0)
    state = Statevector(bound.circuit)
    assert abs(abs(state.inner(Statevector(fixed))) - 1) < 1e-10
    pub = bound.pub((fixed, "ZZ"))
    assert StatevectorEstimator().run([pub]).result()[0].data.evs.shape == ()


SKOLIK = skolik()

BAD: dict[str, tuple[Any, str]] = {
    "no circuit": (lambda: qcompile.qiskit.late("h 0"), "takes a QuantumCircuit, found"),
    "no keep": (lambda: qcompile.qiskit.late(skolik(), keep="x"), 'It is "state" or "z"'),
    "no qubits": (lambda: qcompile.qiskit.late(QuantumCircuit()), "no qubits"),
    "no target": (lambda: qcompile.qiskit.late(skolik(), "fake_lima"), "takes a Target or"),
    "not transpiled": (lambda: qcompile.qiskit.late(skolik(), FakeLimaV2()), "no cz on qubits 0"),
    "too wide": (
        lambda: qcompile.qiskit.late(QuantumCircuit(9), FakeLimaV2()),
        "9 qubits; the target has 5",
    ),
    "a shape": (lambda: qcompile.qiskit.late(skolik()).angles(np.zeros((3, 7))), "the 28 param"),
    "words": (lambda: qcompile.qiskit.late(skolik()).angles(["a"] * 28), "as real numbers"),
    "not finite": (
        lambda: qcompile.qiskit.late(skolik()).angles(np.full(28, np.nan)),
        "not a finite number",
    ),
    "another circuit": (
        lambda: qcompile.qiskit.late(skolik()).pub((efficient_su2(2), np.zeros(16))),
        "another circuit",
    ),
    "no pub": (lambda: qcompile.qiskit.late(skolik()).pub(3), "Qiskit cannot read this as a PUB"),
    "x of z": (
        lambda: qcompile.qiskit.late(SKOLIK, keep="z").pub((SKOLIK, "IIIX", np.zeros(28))),
        "IIIX is not a product of Z",
    ),
    "imaginary": (
        lambda: qcompile.qiskit.late(_with(Parameter("a").log())).angles(np.array([-1.0])),
        "is not (real|a finite number)",
    ),
}


def _with(angle: ParameterExpression) -> QuantumCircuit:
    circuit = QuantumCircuit(1)
    circuit.rx(angle, 0)
    return circuit


@pytest.mark.parametrize("case", BAD)
def test_nonsense_gets_one_clear_line(case: str) -> None:
    call, words = BAD[case]
    with pytest.raises(qcompile.QcompileError, match=words):
        call()


def test_a_name_that_is_code_is_never_run() -> None:
    name = "__import__('sys').exit(3)"
    circuit = _with(Parameter(name).sin())
    found = qcompile.qiskit.late(circuit).angles(np.array([[0.5]]))
    expected = Statevector(circuit.assign_parameters([0.5]))
    template = qcompile.qiskit.late(circuit).circuit.assign_parameters(found[0])
    assert abs(abs(expected.inner(Statevector(template))) - 1) < 1e-10
