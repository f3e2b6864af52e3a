"""Gates on numbered qubits become circuits of connected qubits."""

from __future__ import annotations

import numpy as np
import pytest
from several import difference, program_operator
from wide import ANY, random_circuit, value

from qcompile.ir import Circuit, Gate, Program
from qcompile.ir.connected import connected
from qcompile.ir.wires import Wires, steps


def wires(*texts: str) -> Wires:
    """The gates of texts such as "cx@0,4"."""
    made = Wires()
    for text in texts:
        (gate,) = Circuit.parse(text, 9).gates
        made.apply(steps([gate]), range(9))
    return made


def test_connected_qubits_are_a_circuit_where_its_first_qubit_comes() -> None:
    made = wires("h@4", "x@1", "cx@4,0", "ry(x0)@3", "cz@5,3", "s@0", "cx@0,5")
    circuits, qubits = made.circuits(7)
    assert qubits == (0, 3, 4, 5, 1, 2, 6)
    assert [circuit.width for circuit in circuits] == [4, 1, 1, 1]
    assert str(circuits[0]) == "h@2 cx@2,0 ry(x0)@1 cz@3,1 s@0 cx@0,3"
    assert list(map(str, circuits[1:])) == ["x", "", ""]


def test_a_list_has_the_gates_of_its_qubit() -> None:
    made = wires("h@4", "cx@4,0", "s@0", "cx@4,0", "t@2")
    assert list(map(str, made.gates[0])) == ["cx@4,0", "s", "cx@4,0"]
    assert [len(made.gates[qubit]) for qubit in (0, 2, 4)] == [3, 1, 3]


def test_steps_act_on_the_qubits_that_they_are_given() -> None:
    made, gate = Wires(), steps(Circuit.parse("h@0 cx@0,2 rz(0.5)@1", 3).gates)
    for qubits in ((0, 1, 2), (5, 4, 3)):
        made.apply(gate, qubits)
    circuits, qubits = made.circuits(6)
    assert qubits == (0, 2, 1, 3, 5, 4)
    assert list(map(str, circuits)) == ["h@0 cx@0,1", "rz(0.5)", "h@1 cx@1,0", "rz(0.5)"]


def test_equal_gates_are_one_object() -> None:
    made, h = Wires(), steps([Gate("h")])
    made.apply(steps([Gate("cx", None, (0, 1))]), (0, 1))
    for _ in range(3):
        made.apply(h, (1,))
        made.apply(steps([Gate("cx", None, (0, 1))]), (0, 1))
    ((circuit,), _) = made.circuits(2)
    assert len(circuit) == 7
    assert len({id(gate) for gate in circuit.gates}) == 2


@pytest.mark.parametrize("seed", range(30))
def test_the_operator_is_that_of_the_gates_in_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = {"x0": 0.3, "x1": -1.1, "theta0": 0.7, "theta1": 2.0}
    count = int(rng.integers(1, 6))
    whole = random_circuit(rng, ANY, count).substitute(values)
    assert all(value(angle, values) == angle.constant for angle in whole.angles)
    made = Wires()
    made.apply(steps(whole.gates), range(count))
    circuits, qubits = made.circuits(count)
    found = program_operator(Program(circuits), qubits, count)
    wanted = program_operator(Program((whole,)), range(count), count)
    assert difference(found, wanted) < 1e-12


def test_connected_groups_come_in_the_order_of_the_qubits() -> None:
    assert connected([3, 1, 0, 7, 2], [(0, 7), (7, 1), (2, 2)]) == [[3], [1, 0, 7], [2]]
    assert connected([3, 1], [(3, 9), (9, 1)]) == [[3, 1]]
    assert connected([], []) == []
