"""Names that OpenQASM reserves are replaced when a program is written."""

from __future__ import annotations

import pytest

from qcompile.ir import Circuit, Program
from qcompile.qasm import Layout, Register, read, write
from qcompile.qasm.names import legal_names, renamed

PROGRAM = Program((Circuit.parse("rx(p+0.5)"), Circuit.parse("rz(lambda)")), ("p", "lambda"))


def layout(qubits: str, bits: str) -> Layout:
    registers = (Register(qubits, 2),), (Register(bits, 2),)
    return Layout(*registers, ((qubits, 0), (qubits, 1)), ((bits, 0), (bits, 1)))


def test_reserved_names_get_an_underscore():
    other = legal_names(PROGRAM, layout("in", "output"), "3")
    assert other == {"p": "p_", "in": "in_", "output": "output_"}
    program, changed = renamed(PROGRAM, layout("in", "output"), other)
    source = read(write(program, layout=changed))
    assert source.layout == layout("in_", "output_")
    assert source.program.inputs == ("p_", "lambda")
    assert source.program.circuits == (Circuit.parse("rx(p_+0.5)"), Circuit.parse("rz(lambda)"))


def test_new_names_are_nobody_elses():
    assert legal_names(PROGRAM, layout("x", "x_"), "3") == {"p": "p_", "x": "x__"}
    assert legal_names(Program((), ("x", "x_")), layout("h", "h_"), "3") == {"x": "x__", "h": "h__"}


@pytest.mark.parametrize(
    ("name", "new"), [("Q", "rQ"), ("_a", "r_a"), ("θ", "r_"), ("aθ", "a_"), ("q", None)]
)
def test_openqasm_2_has_ascii_names_that_begin_small(name, new):
    program = Program((Circuit(), Circuit()))
    assert legal_names(program, layout(name, "c"), "2") == ({} if new is None else {name: new})


def test_greek_names_may_stay_in_openqasm_3():
    assert legal_names(Program((Circuit.parse("rx(θ)"),) * 2, ("θ",)), layout("q", "ϕ"), "3") == {}
