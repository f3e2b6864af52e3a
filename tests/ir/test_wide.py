"""Circuits of several qubits and observables: text, lists, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import pytest

from qcompile.errors import CircuitError
from qcompile.ir import Circuit, Gate, Program

LISTS = [["h", 0], ["ry", "x0", 1], ["cz", 0, 1], ["cx", 2, 1], ["rz", 0.5, 2]]
TEXT = "h@0 ry(x0)@1 cz@0,1 cx@2,1 rz(0.5)@2"


def program() -> Program:
    circuits = [Circuit.of(LISTS, 3), Circuit.parse("h ry(x1)"), Circuit.parse("ecr@0,1", 2)]
    return replace(Program.of(circuits, 2), observables=((2, 0), (3,), (4, 5)))


def test_a_wide_circuit_has_three_equal_forms() -> None:
    circuit = Circuit.of(LISTS, 3)
    gates = (
        Gate("h"),
        Gate.of("ry", "x0", qubits=(1,)),
        Gate("cz", None, (0, 1)),
        Gate("cx", None, (2, 1)),
        Gate.of("rz", 0.5, qubits=(2,)),
    )
    assert circuit == Circuit(gates, 3) == Circuit.parse(TEXT, 3)
    assert str(circuit) == TEXT
    assert circuit.to_lists() == LISTS
    assert circuit != Circuit.of(LISTS, 4)


def test_a_wide_program_has_a_text_form() -> None:
    assert str(program()).splitlines() == [
        "inputs x0 x1",
        "parameters",
        f"0[3]: {TEXT}",
        "1: h ry(x1)",
        "2[2]: ecr@0,1",
        "observables 0,2 3 4,5",
    ]
    assert Program.parse(str(program())) == program()
    assert repr(program()) == (
        "Program(3 circuits, 6 qubits, 2 inputs, 0 parameters, 3 observables)"
    )


def test_bits_are_those_of_the_circuits_in_order() -> None:
    assert (program().widths, program().bits, program().first_bits) == ((3, 1, 2), 6, (0, 3, 4))
    assert program().measured == ((0, 2), (3,), (4, 5))
    alone = tuple((bit,) for bit in range(6))
    assert replace(program(), observables=()).measured == alone
    assert replace(program(), observables=alone) == replace(program(), observables=())


def test_copies_keep_their_observables() -> None:
    twice = program().side_by_side(2)
    assert twice.widths == (3, 1, 2, 3, 1, 2)
    assert twice.measured == ((0, 2), (3,), (4, 5), (6, 8), (9,), (10, 11))
    assert program().substitute({"x0": 1.0}).observables == program().observables


@pytest.mark.parametrize(
    ("observable", "message"),
    [
        ((0, 3), "bits 0,3, of the circuits 0 and 1.\n  The bits of an observable belong to one"),
        ((6,), "bits 6.\n  The program has bits 0 to 5"),
        ((1, 1), "bits 1,1: one of them twice"),
        ((), "bits none"),
    ],
)
def test_an_observable_is_a_set_of_bits_of_one_circuit(
    observable: tuple[int, ...], message: str
) -> None:
    with pytest.raises(CircuitError, match=f"Observable 1 has the {message}"):
        replace(program(), observables=((0,), observable))


@pytest.mark.parametrize(
    ("lists", "message"),
    [
        ([["cz", 0, 0]], "'cz' acts on qubit 0 twice"),
        ([["cz", 0, 2]], "acts on qubit 2 of a circuit on 2.\n  Its qubits are 0 to 1"),
        ([["cz", 0]], r'\["cz", 0, 1\]'),
        ([["h", 0, 1]], "Gate 'h' takes no angle"),
        ([["ry", "x0"]], "'x0' is not a qubit"),
        ([["cx", 0.5, 0, 1]], "Gate 'cx' takes no angle"),
        ([["h", True]], "True is not a qubit"),
    ],
)
def test_gates_act_on_qubits_that_are_there(lists: list[list[object]], message: str) -> None:
    with pytest.raises(CircuitError, match=message):
        Circuit.of(lists, 2)


def test_a_gate_knows_how_many_qubits_it_has() -> None:
    with pytest.raises(CircuitError, match="Gate 'cx' acts on two qubits, not 1"):
        Gate("cx")
    with pytest.raises(CircuitError, match="Gate 'h' acts on one qubit, not 2"):
        Gate("h", None, (0, 1))
    with pytest.raises(CircuitError, match="'h' names no qubit"):
        Circuit.parse("h", 2)
    with pytest.raises(CircuitError, match="acts on qubit 1 of a circuit on 1"):
        Circuit((Gate("h", None, (1,)),))
