"""OpenQASM 2 by its own grammar, and common statements by both grammars."""

from __future__ import annotations

import random

import numpy as np
import pytest
from openqasm3.parser import parse
from qasm.test_read import expectations, qiskit_expectations

from qcompile.errors import ProgramFileError
from qcompile.ir import Circuit
from qcompile.qasm import Register, read
from qcompile.qasm.grammar import parse_3
from qcompile.qasm.terms import WORDS_2, WORDS_3, ParseError

qiskit_qasm2 = pytest.importorskip("qiskit.qasm2")
qiskit_qasm3 = pytest.importorskip("qiskit.qasm3")

HEAD = 'OPENQASM 2.0;\ninclude "qelib1.inc";\n'
ORDINARY = sorted(WORDS_3 - WORDS_2 - {"true", "false", "im", "nop"})


def circuits(*texts: str) -> tuple[Circuit, ...]:
    return tuple(map(Circuit.parse, texts))


@pytest.mark.parametrize("name", [*ORDINARY, "p", "u", "sx", "tau", "euler", "π"])
def test_words_of_openqasm_3_are_names_in_openqasm_2(name):
    text = f"{HEAD}qreg {name}[2];\ncreg c[2];\nx {name}[1];\nmeasure {name} -> c;\n"
    source = read(text)
    assert source.program.circuits == circuits("", "x")
    assert source.layout.qubit_registers == (Register(name, 2),)
    if name.isascii():
        assert qiskit_qasm2.loads(text).count_ops() == {"x": 1, "measure": 2}


@pytest.mark.parametrize("name", ["in", "output", "gphase", "pow", "ctrl", "inv", "u", "sx", "for"])
def test_gates_and_their_parameters_may_have_such_names_too(name):
    text = (
        f"{HEAD}gate {name}(lambda) input {{ rx(lambda/2) input; barrier input; h input; }}\n"
        f"qreg q[1];\n{name}(0.5) q[0];\n{name}(pi) q;\n"
    )
    assert read(text).program.circuits == circuits("rx(0.25) h rx(pi/2) h")


def test_the_words_of_openqasm_3_stay_reserved_there():
    with pytest.raises(ProgramFileError, match=r"p:2: Syntax error at 'in'"):
        read("OPENQASM 3.0;\nqubit in;\n", "p")


def test_a_file_without_a_version_may_use_either():
    assert read("qreg in[1];\nx in[0];\nqubit r;\nrx(1.0/2) r;\n").program.circuits == circuits(
        "x", "rx(0.5)"
    )


def test_openqasm_2_with_words_of_openqasm_3_is_still_read():
    source = read("OPENQASM 2.0;\nqubit[2] q;\nbit c;\ninv @ s q[0];\nc = measure q[0];\n")
    assert source.program.circuits == circuits("sdg", "")


def test_opaque_gates_may_be_declared_but_not_used():
    head = HEAD + "opaque ecr q0,q1;\nopaque magic(a, b) q0;\nqreg q[2];\n"
    assert read(head + "x q[0];\n").program.circuits == circuits("x", "")
    with pytest.raises(ProgramFileError) as caught:
        read(head + "magic(1, 2) q[0];\n", "p")
    assert str(caught.value) == (
        "p:6: Gate 'magic' is opaque: the file does not define it.\n"
        "  Define it: gate magic ... { ... }"
    )
    known = read(head + "ecr q[0],q[1];\n").program.circuits
    assert known == (Circuit.parse("ecr@0,1", 2),)


def test_a_register_of_no_bits_may_be_declared():
    source = read(HEAD + "qreg q[1];\ncreg c[0];\ncreg d[1];\nmeasure q -> d;\n")
    assert source.layout.bit_registers == (Register("c", 0), Register("d", 1))


def test_the_global_phase_that_pennylane_writes():
    assert read(HEAD + "qreg q[1];\nh q[0];\ngphase(0.3) q[0];\n").program.circuits == circuits("h")


@pytest.mark.parametrize(
    ("text", "line", "token"),
    [
        ("qreg q[2]\nx q[0];", 4, "x"),
        ("qreg q[2];\nx q[0;", 4, ";"),
        ("qreg q[2];\ngate g(a b { }", 4, "b"),
        ("qreg q[2];\nx\n q[0] q[1];", 5, "q"),
    ],
)
def test_syntax_errors_name_the_line_and_the_word(text, line, token):
    with pytest.raises(ProgramFileError) as caught:
        read(HEAD + text + "\n", "p")
    assert str(caught.value).startswith(f"p:{line}: Syntax error at {token!r}.\n")


@pytest.mark.parametrize(
    "text",
    [
        "h q;", "rx(0.5) q[0];", "rx(-pi/2+3*2e-1) q[n-1];", "u3(1,.5,2.) q[0];", "x $3;",
        "cx q[0], q[1];", "g(a**2**-b, -a**2, sin(a)*(b+c)) q;", "g() q;",
        "gate g(a, b) c, d { rx(a-b-1) c; barrier c, d; cx c, d; }", "gate g a { }",
        "measure q[0] -> c[1];", "c[1] = measure q[0];", "c = measure q;", "measure q;",
        "reset q;", "barrier q[0], r;", 'include "stdgates.inc";', "rx(θ/2) q;",
        "rx(a*b/c*d) q;", "rx(2*-a) q;", "rx(-(-a)) q;",
        "inv @ x q;", "pow(1/2.0) @ inv @ U(0, a, 1) q[0];", "ctrl(2) @ gphase(a) q, r;",
        "gphase(1);", "negctrl @ x q, r;", "gate g(a) b { pow(2) @ x b; gphase(a/2); }",
        "const angle[32] a = 2.5*pi;", "bool b;", "uint[n+1] a = 3;", "float a = sin(b);",
        "a = b/2;", "a += 1;", "a **= 2;", "a -= b*2;",
    ],
)  # fmt: skip
def test_common_statements_are_the_nodes_of_the_full_parser(text):
    assert parse_3(text, 1) == parse(text).statements[0]


@pytest.mark.parametrize(
    "text",
    [
        "x in[0];", "bit b = 1;", "float(a);", "a = b[0];", "a <<= 1;", "rx(a ^ b) q;", "x q[0:1];",
        "rx(1_000) q;", "rx(0x1f) q;", "rx(2ns) q;", "let a = q;", "rx(float(1)) q;", "x q",
        "if (a) x q;", "rx(a % b) q;", "x² q;", "barrier;", "gate g() { }",
    ],
)  # fmt: skip
def test_other_statements_are_left_to_the_full_parser(text):
    with pytest.raises(ParseError):
        parse_3(text, 1)


@pytest.mark.parametrize("seed", range(20))
def test_random_openqasm_3_agrees_with_qiskit(seed):
    rng = random.Random(seed)
    numbers = ["pi/2", "-π/7", "0.3", "2*(1-.25)", "-3e-1*pi"]
    lines = [
        'OPENQASM 3.0;\ninclude "stdgates.inc";\nqubit[3] q;',
        "gate turn(a, p) u { U(a,-p,p/2) u; h u; inv @ rx(-a*2) u; }\nlet r = q[1:2];",
    ]
    for _ in range(30):
        kind = rng.choice(["h", "t", "sdg", "sx", "rx", "u2", "U", "u3", "turn", "p", "id"])
        count = {"rx": 1, "p": 1, "u2": 2, "turn": 2, "u3": 3, "U": 3}.get(kind, 0)
        angles = f"({','.join(rng.choice(numbers) for _ in range(count))})" if count else ""
        modifier = rng.choice(["", "", "inv @ ", "pow(2) @ "])
        lines.append(f"{modifier}{kind}{angles} {rng.choice(['q', 'r', 'q[0]', 'r[1]', 'q[2]'])};")
    text = "\n".join(lines)
    theirs = qiskit_expectations(qiskit_qasm3.loads(text))
    np.testing.assert_allclose(expectations(read(text)), theirs, atol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_random_openqasm_2_agrees_with_qiskit(seed):
    rng = random.Random(seed)
    angle = lambda: rng.choice(["pi/2", "-pi^2/7", "0.3", "2*(1-.25)", "sin(0.2)+1", "-3e-1*pi"])  # noqa: E731
    lines = [HEAD + "gate turn(in, p) u { u3(in,-p,p/2) u; h u; rx(-in^2) u; }\nqreg in[3];"]
    for _ in range(30):
        kind = rng.choice(["h", "t", "sdg", "rx", "u2", "u3", "turn", "u1", "id"])
        count = {"rx": 1, "u1": 1, "u2": 2, "turn": 2, "u3": 3}.get(kind, 0)
        angles = f"({','.join(angle() for _ in range(count))})" if count else ""
        lines.append(f"{kind}{angles} in{rng.choice(['', '[0]', '[1]', '[2]'])};")
    text = "\n".join(lines)
    theirs = qiskit_expectations(qiskit_qasm2.loads(text))
    np.testing.assert_allclose(expectations(read(text)), theirs, atol=1e-9)
