"""Gates, circuits and programs: the table, the text form, and what is refused."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from qiskit.circuit import library

from qcompile.errors import CircuitError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Angle, Circuit, Gate, LateAngle, Program

GATE_CLASSES = {
    "id": library.IGate, "x": library.XGate, "y": library.YGate, "z": library.ZGate,
    "h": library.HGate, "s": library.SGate, "sdg": library.SdgGate, "t": library.TGate,
    "tdg": library.TdgGate, "sx": library.SXGate, "sxdg": library.SXdgGate,
    "rx": library.RXGate, "ry": library.RYGate, "rz": library.RZGate, "p": library.PhaseGate,
}  # fmt: skip

numbers = st.one_of(st.floats(-50, 50), st.sampled_from([0.0, math.pi, -math.pi / 2]))
angles = st.builds(
    lambda number, terms: sum((Angle.symbol(s) * c for s, c in terms.items()), Angle.of(number)),
    numbers,
    st.dictionaries(st.sampled_from(["x0", "x1", "theta0"]), numbers, max_size=3),
)
gates = st.one_of(
    st.sampled_from([Gate(name) for name in FIXED_GATES]),
    st.builds(Gate, st.sampled_from(list(ROTATION_GATES)), angles),
)
circuits = st.lists(gates, max_size=8).map(lambda made: Circuit(tuple(made)))


def test_the_gate_table_is_the_one_tested() -> None:
    assert {*FIXED_GATES, *ROTATION_GATES} == set(GATE_CLASSES)


@pytest.mark.parametrize("name", GATE_CLASSES)
def test_rotations_are_qiskit_s_matrix_up_to_phase(name: str) -> None:
    for value in (0.7, -2.9, math.pi, 5.0):
        arguments = (value,) if name in ROTATION_GATES else ()
        theirs = GATE_CLASSES[name](*arguments).to_matrix()
        ours = np.eye(2)
        for axis, angle in Gate.of(name, *arguments).rotations:
            assert angle.is_constant
            ours = GATE_CLASSES["r" + axis](angle.constant).to_matrix() @ ours
        overlap = np.trace(ours.conj().T @ theirs)
        np.testing.assert_allclose(ours * overlap / 2, theirs, atol=1e-15)


@given(circuits)
def test_a_circuit_reads_back_from_its_text_and_lists(circuit: Circuit) -> None:
    assert Circuit.parse(str(circuit)) == circuit
    assert Circuit.of(circuit.to_lists()) == circuit


@given(st.lists(circuits, max_size=4), circuits)
def test_a_program_reads_back_from_its_text(made: list[Circuit], block: Circuit) -> None:
    program = Program(tuple(made), ("x0", "x1"), ("theta0",), (LateAngle("a", block, "polar"),))
    again = Program.parse(str(program))
    assert again == program
    assert hash(again) == hash(program)


def test_circuits_from_lists_and_text_are_equal() -> None:
    listed = Circuit.of([["h"], ["ry", "x0"], ["rz", 0.5], ["ry", "theta0-pi/2"]])
    parsed = Circuit.parse(" h ry( x0 )rz(0.5)  ry(theta0-(pi/2)) ")
    assert listed == parsed
    assert hash(listed) == hash(parsed)
    assert len(listed) == 4
    assert listed.symbols == ("x0", "theta0")
    assert listed.to_lists() == [["h"], ["ry", "x0"], ["rz", 0.5], ["ry", "theta0-pi/2"]]


def test_circuits_and_gates_cannot_change() -> None:
    circuit = Circuit.parse("h")
    with pytest.raises(dataclasses.FrozenInstanceError):
        circuit.gates = ()
    with pytest.raises(dataclasses.FrozenInstanceError):
        circuit.gates[0].name = "x"
    with pytest.raises(dataclasses.FrozenInstanceError):
        Program((circuit,)).circuits = ()


def test_substitution_leaves_the_original() -> None:
    circuit = Circuit.parse("h ry(x0+theta0)")
    assert circuit.substitute({"x0": 1.0}) == Circuit.parse("h ry(theta0+1)")
    assert circuit == Circuit.parse("h ry(x0+theta0)")
    program = Program.of([circuit], 1, 1).substitute({"theta0": 2.0})
    assert program == Program((Circuit.parse("h ry(x0+2)"),), ("x0",), ())


@pytest.mark.parametrize(
    ("name", "near"), [("sxd", "sxdg"), ("rzz", "rz"), ("qx", None), ("H", None), ("u3", None)]
)
def test_an_unknown_gate_brings_the_nearest(name: str, near: str | None) -> None:
    with pytest.raises(CircuitError, match=f"Unknown gate '{name}'") as caught:
        Gate.of(name)
    message = str(caught.value)
    assert "Known gates: id x y z h s sdg t tdg sx sxdg rx ry rz p cx cz ecr." in message
    assert (f"Did you mean {near}" in message) if near else True


def test_angles_are_neither_missing_nor_too_many() -> None:
    with pytest.raises(CircuitError, match=r"Gate 'h' takes no angle.\n  Found 1.0"):
        Gate.of("h", 1.0)
    with pytest.raises(CircuitError, match="Gate 'ry' needs an angle"):
        Gate.of("ry")


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_an_angle_is_finite(value: float) -> None:
    with pytest.raises(CircuitError, match="not finite"):
        Gate.of("ry", value)


@pytest.mark.parametrize(
    "text",
    ["ry(__import__('os').system('true'))", "ry(__import__('os'))", "ry(x0", "ry)", "h;", "0h",
     "ry()", "h()", "ry(x0*x1)", "ry(1)(2)", "h, x"],
)  # fmt: skip
def test_a_wrong_text_is_refused(text: str) -> None:
    with pytest.raises(CircuitError):
        Circuit.parse(text)


@pytest.mark.parametrize(
    "gate",
    ["h", ["h", 1, 2], [], [1], 5, None, ["ry", None], ["ry", [1]], ["ry", True], ["ry", 1j], {}],
)
def test_a_wrong_list_is_refused(gate: object) -> None:
    with pytest.raises(CircuitError):
        Circuit.of([gate])


def test_an_undeclared_symbol_is_named_with_its_circuit() -> None:
    with pytest.raises(CircuitError, match=r"Unknown symbol 'x1' in circuit 1.\n  Declared: x0."):
        Program.of([Circuit.parse("ry(x0)"), Circuit.parse("ry(x1)")], inputs=1)


def test_the_block_of_a_late_angle_uses_inputs_and_parameters_only() -> None:
    first = LateAngle("a", Circuit.parse("ry(x0)"), "polar")
    second = LateAngle("b", Circuit.parse("ry(a)"), "polar")
    Program((Circuit.parse("ry(a)"),), ("x0",), (), (first,))
    with pytest.raises(CircuitError, match="Unknown symbol 'a'"):
        Program((), ("x0",), (), (first, second))


@pytest.mark.parametrize(
    ("inputs", "parameters", "late_angles"),
    [(("a", "a"), (), ()), (("a",), ("a",), ()), ((), ("a",), ("a",))],
)
def test_no_symbol_is_declared_twice(inputs, parameters, late_angles) -> None:
    made = tuple(LateAngle(name, Circuit(), "first") for name in late_angles)
    with pytest.raises(CircuitError, match="'a' is declared twice"):
        Program((), inputs, parameters, made)


def test_a_fused_program_cannot_be_substituted() -> None:
    fused = Program((), ("x0",), (), (LateAngle("a", Circuit(), "first"),))
    with pytest.raises(CircuitError, match="cannot be substituted"):
        fused.substitute({"x0": 1.0})


def test_copies_side_by_side_share_parameters_alone() -> None:
    program = Program.of(map(Circuit.parse, ["h ry(x0+theta0)", "rz(2*x1) ry(theta0)"]), 2, 1)
    assert str(program.side_by_side(2)) == (
        "inputs x0_0 x1_0 x0_1 x1_1\n"
        "parameters theta0\n"
        "0: h ry(theta0+x0_0)\n"
        "1: rz(2.0*x1_0) ry(theta0)\n"
        "2: h ry(theta0+x0_1)\n"
        "3: rz(2.0*x1_1) ry(theta0)"
    )
    assert program.side_by_side(1) is program


def test_names_of_copies_do_not_collide() -> None:
    program = Program((Circuit.parse("ry(a) rz(a_0) ry(a_1)"),), ("a", "a_0"), ("a_1",))
    assert program.side_by_side(2).inputs == ("a__0", "a_0__0", "a__1", "a_0__1")


def test_a_fused_program_cannot_be_copied() -> None:
    fused = Program((), ("x0",), (), (LateAngle("a", Circuit(), "first"),))
    with pytest.raises(CircuitError, match="cannot be copied"):
        fused.side_by_side(2)


@pytest.mark.parametrize(
    "text", ["nonsense", "1: h", "0: h\n0: x", "where a = middle{h}", "0: ry(x0)", "0 h"]
)
def test_a_wrong_program_text_is_refused(text: str) -> None:
    with pytest.raises(CircuitError):
        Program.parse(text)


def test_the_text_form_of_a_program() -> None:
    program = Program(
        (Circuit.parse("h ry(x0)"), Circuit()),
        ("x0",),
        (),
        (LateAngle("a", Circuit.parse("ry(x0)"), "last"),),
    )
    assert str(program) == "inputs x0\nparameters\n0: h ry(x0)\n1:\nwhere a = last{ry(x0)}"
