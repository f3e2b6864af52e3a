"""Late binding of what is seldom in a circuit: odd names, gates of users, loops, large angles."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.circuit import Gate, Parameter, ParameterVector
from qiskit.circuit.library import RZZGate
from qiskit.primitives.containers import EstimatorPub, SamplerPub
from qiskit.primitives.containers.bindings_array import BindingsArray
from qiskit.quantum_info import Statevector
from qiskit.transpiler import generate_preset_pass_manager
from qiskit_ibm_runtime.fake_provider import FakeTorino

import qcompile

A, B, C = (Parameter(name) for name in "abc")


def state(circuit: QuantumCircuit) -> np.ndarray:
    """The statevector, with gates of users replaced by what defines them."""
    return np.asarray(Statevector(circuit.decompose(reps=3)))


def assert_kept(circuit: QuantumCircuit, like: QuantumCircuit | None = None) -> None:
    """Binding late prepares the state of the circuit, or of one that is `like` it."""
    bound = qcompile.qiskit.late(circuit)
    for row in np.random.default_rng(0).uniform(-4, 4, (3, circuit.num_parameters)):
        values = dict(zip(circuit.parameters, row, strict=True))
        found = state(bound.circuit.assign_parameters(bound.angles(row)))
        expected = state((circuit if like is None else like).assign_parameters(values))
        assert abs(abs(np.vdot(expected, found)) - 1) < 1e-10


@pytest.mark.parametrize(
    "names",
    [("x0", "x1", "x2"), ("p0", "p1", "e0"), ("lambda", "1", "a b"), ("I", "pi", ""), ("a0_0",)],
)
def test_any_name_of_a_parameter(names: tuple[str, ...]) -> None:
    """x0 is what sympy calls the first part that expressions share."""
    parameters = [Parameter(name) for name in names]
    circuit = QuantumCircuit(2)
    for parameter in parameters:
        circuit.rx(parameter - 0.3, 1)
        circuit.cx(0, 1)
        for sign in (0.5, -0.5):
            circuit.rz(sign * parameters[-1] * parameters[0], 0)
            circuit.sx(0)
    assert_kept(circuit)


def test_parameters_called_as_those_of_the_template() -> None:
    vector = ParameterVector("late", 3)
    circuit = QuantumCircuit(2)
    circuit.h(range(2))
    circuit.crx(vector[2], 0, 1)
    circuit.crx(vector[1] * vector[0], 1, 0)
    circuit.crx(vector[0], 0, 1)
    circuit.cp(vector[1] + vector[2], 0, 1)
    circuit.rx(vector[0], 0)
    assert_kept(circuit)


@pytest.mark.parametrize(
    "name", ["cz", "cx", "ecr", "cp", "rzz", "swap", "global_phase", "barrier"]
)
def test_a_gate_of_the_user_may_have_any_name(name: str) -> None:
    inner = QuantumCircuit(2, name=name)
    inner.h(0)
    inner.cx(0, 1)
    inner.ry(A, 1)
    circuit = QuantumCircuit(2)
    circuit.h(range(2))
    for qubits in ((0, 1), (1, 0)):
        circuit.rz(B, 0)
        circuit.rz(0.7, 1)
        circuit.append(inner.to_gate(), qubits)
    circuit.rx(A * B, 0)
    assert_kept(circuit)


@pytest.mark.parametrize("name", ["measure", "barrier", "delay", "rz", "sx"])
def test_a_gate_of_the_user_on_one_qubit_may_have_any_name(name: str) -> None:
    inner = QuantumCircuit(1, name=name)
    inner.rx(A, 0)
    circuit = QuantumCircuit(2)
    circuit.h(0)
    circuit.rz(B, 0)
    circuit.append(inner.to_gate(), [0])
    circuit.cx(0, 1)
    circuit.h(0)
    circuit.rz(B, 0)
    circuit.append(QuantumCircuit(1, name=name).to_gate(), [0])
    assert_kept(circuit)


def test_a_gate_without_a_definition_stays() -> None:
    """Its name says nothing: a gpi of IonQ takes turns, not radians."""
    circuit = QuantumCircuit(1)
    circuit.rx(A, 0)
    circuit.append(Gate("gpi", 1, [B]), [0])
    circuit.append(Gate("h", 1, []), [0])
    counts = qcompile.qiskit.late(circuit).circuit.count_ops()
    assert (counts["gpi"], counts["h"]) == (1, 1)


def test_loops_over_an_angle() -> None:
    """One within another, whose variable has the name of an angle of the template."""
    angle, count = Parameter("late[0]"), Parameter("i")
    inner, outer, circuit = (QuantumCircuit(2) for _ in range(3))
    inner.crx(angle * A, 0, 1)
    outer.rx(count + B, 0)
    outer.for_loop([1, 2], angle, inner, range(2), [])
    circuit.ry(B, 0)
    circuit.ry(A, 0)
    circuit.for_loop(range(2), count, outer, range(2), [])
    circuit.ry(C, 1)
    bound = qcompile.qiskit.late(circuit)
    assert {p.name.split("[")[0] for p in bound.circuit.parameters} == {"late_"}
    values = np.array([0.4, 1.1, -2.0])
    (expected,) = circuit.assign_parameters(values).get_instructions("for_loop")
    template = bound.circuit.assign_parameters(bound.angles(values))
    (found,) = template.get_instructions("for_loop")
    assert found.operation == expected.operation


def test_the_source_stays_open() -> None:
    """Qiskit binds a gate of the user in a block where it is, not a copy."""
    inner = QuantumCircuit(1, name="mine")
    inner.rx(A, 0)
    circuit = QuantumCircuit(1)
    with circuit.box(), circuit.box():
        circuit.append(inner.to_gate(), [0])
    qcompile.qiskit.late(circuit)
    box = circuit.data[0].operation.blocks[0].data[0].operation
    assert box.blocks[0].data[0].operation.params == [A]


def test_an_angle_whose_parameters_cancel() -> None:
    """Qiskit cannot hash -2, the value of this expression."""
    circuit = QuantumCircuit(1)
    circuit.rx(A * 0 - 2, 0)
    circuit.rz(B, 0)
    circuit.rx(B, 0)
    assert_kept(circuit)


@pytest.mark.parametrize("angle", [1e8, -1e12, 1e15, 5 * math.pi / 2, -math.pi, 1e-300])
def test_large_angles_of_rzz_are_folded_exactly(angle: float) -> None:
    circuit, fixed = QuantumCircuit(2), QuantumCircuit(2)
    for built, value in ((circuit, A), (fixed, angle)):
        built.h(range(2))
        built.append(RZZGate(value, label="mine"), range(2))
    expected = np.array([np.exp(-0.5j * sign * angle) for sign in (1, -1, -1, 1)]) / 2
    bound = qcompile.qiskit.late(circuit)
    templates = [
        qcompile.qiskit.late(fixed).circuit,
        bound.circuit.assign_parameters(bound.angles([angle])),
    ]
    for template in templates:
        assert abs(abs(np.vdot(expected, Statevector(template))) - 1) < 1e-12
        (instruction,) = template.get_instructions("rzz")
        assert instruction.operation.label == "mine"
        assert 0 <= instruction.params[0] <= math.pi / 2


def two_angles() -> QuantumCircuit:
    circuit = QuantumCircuit(2)
    circuit.rx(A, 0)
    circuit.ry(A * B, 0)
    circuit.cx(0, 1)
    return circuit


def test_pickled_and_unpickled_it_gives_the_same_angles() -> None:
    bound = qcompile.qiskit.late(two_angles(), keep="z")
    again = pickle.loads(pickle.dumps(bound))
    values = np.array([[0.3, 0.4], [1.0, -7.0]])
    assert again.keep == "z"
    np.testing.assert_array_equal(again.angles(values), bound.angles(values))


def test_values_by_name() -> None:
    bound = qcompile.qiskit.late(two_angles())
    values = np.array([[0.3, 0.4], [1.0, -7.0]])
    array = BindingsArray({(B, A): values[:, ::-1]})
    np.testing.assert_array_equal(bound.angles(array), bound.angles(values))


def test_pubs_that_could_be_either() -> None:
    fixed = QuantumCircuit(1)
    fixed.h(0)
    pub = qcompile.qiskit.late(fixed).pub((fixed, np.zeros((4, 0))))
    assert isinstance(pub, SamplerPub)
    assert pub.shape == (4,)
    named_x = QuantumCircuit(1)
    named_x.rx(Parameter("X"), 0)
    bound = qcompile.qiskit.late(named_x)
    assert isinstance(bound.pub((named_x, {"X": 0.3})), SamplerPub)
    assert isinstance(bound.pub((named_x, {"X": 0.3}, [0.1])), EstimatorPub)


def test_a_circuit_that_was_changed_is_another() -> None:
    circuit = two_angles()
    bound = qcompile.qiskit.late(circuit)
    circuit.measure_all()
    with pytest.raises(qcompile.QcompileError, match="another circuit"):
        bound.pub((circuit, np.zeros(2)))
    assert bound.pub((two_angles(), np.zeros(2))).circuit is bound.circuit


def test_the_template_is_not_scheduled() -> None:
    manager = generate_preset_pass_manager(
        1, FakeTorino(), scheduling_method="alap", seed_transpiler=0
    )
    isa = manager.run(two_angles())
    assert len(isa.op_start_times) == len(isa.data)
    with pytest.raises(AttributeError, match="not scheduled"):
        _ = qcompile.qiskit.late(isa).circuit.op_start_times


BAD: dict[str, tuple[Callable[[Any], Any], str]] = {
    "ragged": (lambda bound: bound.angles([[1, 2], [3]]), "not an array of real numbers"),
    "masked": (lambda bound: bound.angles(np.ma.array([1, 2], mask=[0, 1])), "not an array of"),
    "no observable": (lambda bound: bound.map_observables(3), "cannot map these observables"),
    "too wide": (lambda bound: bound.map_observables("ZZZ"), "cannot map these observables"),
}


@pytest.mark.parametrize("case", BAD)
def test_nonsense_gets_one_clear_line(case: str) -> None:
    call, words = BAD[case]
    with pytest.raises(qcompile.QcompileError, match=words):
        call(qcompile.qiskit.late(two_angles()))
