"""Invalid programs: the exact error messages, and that no other exception is raised."""

from __future__ import annotations

import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from qcompile.errors import ProgramFileError
from qcompile.qasm import read

HEAD_3 = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
HEAD_2 = 'OPENQASM 2.0;\ninclude "qelib1.inc";\n'

REFUSED = {
    "coupling after a measurement": (
        HEAD_3 + "qubit[2] q;\nbit[2] c;\nc[1] = measure q[1];\n// comment\ncx q[0],q[1];\n",
        "program.qasm:7: cx q[0], q[1] follows the measurement of q[1].\n"
        "  qcompile measures every qubit once, at the end.",
    ),
    "reset after a coupling": (
        "gate bell a, b { h a; CX a, b; }\nqubit[2] q;\nbell q[0], q[1];\nreset q[1];\n",
        "program.qasm:4: reset q[1] comes after a gate or a measurement of its qubit.\n"
        "  qcompile compiles circuits that start in |0>; a reset can only come first.",
    ),
    "one qubit twice": (
        "qubit[2] q;\nswap q[0], q[0];\n",
        "program.qasm:2: swap q[0], q[0] uses a qubit twice.",
    ),
    "one qubit twice in a gate": (
        "gate g a, b { cx a, a; }\nqubit[2] q;\ng q[0], q[1];\n",
        "program.qasm:1: cx a, a uses a qubit twice.",
    ),
    "too few qubits": (
        "qubit[3] q;\nccx q[0], q[1];\n",
        "program.qasm:2: ccx takes 3 qubits, found 2.",
    ),
    "too few qubits beside controls": (
        "qubit[3] q;\nctrl @ swap q[0], q[1];\n",
        "program.qasm:2: swap takes 2 qubits, found 1.",
    ),
    "only controls": (
        "qubit[2] q;\nctrl(2) @ x q[0], q[1];\n",
        "program.qasm:2: ctrl(2) @ x q[0], q[1] takes at least 3 qubits, found 2.\n"
        "  The controls come first, then the qubits of the gate.",
    ),
    "no controls": (
        "qubit q;\nctrl(0) @ x q;\n",
        "program.qasm:2: ctrl(0) @ x q has 0 controls.\n  A controlled gate has at least one.",
    ),
    "a range is one operand": (
        "qubit[40] q;\nqubit t1;\nctrl(39) @ x q[0:38], t1;\n",
        "program.qasm:3: ctrl(39) @ x q[0:38], t1 takes at least 40 qubits, found 2.\n"
        "  The controls come first, then the qubits of the gate.",
    ),
    "too many gates for the controls": (
        "qubit[26] q;\ndef f(qubit[26] r) { ctrl(25) @ x "
        + ", ".join(f"r[{i}]" for i in range(26))
        + "; }\nf(q);\n",
        "program.qasm:2: The program has more than 1000000 gates after expansion.\n"
        "  Check its nested gate definitions and powers.",
    ),
    "a root that is not known": (
        "gate both a, b { x a; h b; }\nqubit[2] q;\npow(0.5) @ both q[0], q[1];\n",
        "program.qasm:3: pow(0.5) of this gate on several qubits is not supported.\n"
        "  Use a whole power, or a power of what it controls.",
    ),
    "unknown gate": (
        "qubit q;\nsxgd q;\n",
        "program.qasm:2: Unknown gate 'sxgd'.\n  Did you mean sxdg?",
    ),
    "missing angle": ("qubit q;\nrx q;\n", "program.qasm:2: rx takes 1 angle, found 0."),
    "angles": ("qubit q;\nu3(1, 2) q;\n", "program.qasm:2: u3 takes 3 angles, found 2."),
    "qubits": ("qubit[2] q;\nh q[0], q[1];\n", "program.qasm:2: h takes 1 qubit, found 2."),
    "own gate's qubits": (
        "gate g(a) b { rx(a) b; }\nqubit[2] q;\ng(1) q[0], q[1];\n",
        "program.qasm:3: g takes 1 qubit, found 2.",
    ),
    "inside an own gate": (
        "gate g(a) b {\n  rx(a) b;\n  ry(c) b;\n}\nqubit q;\ng(1) q;\n",
        "program.qasm:3: Unknown name 'c'.\n  Known: pi, tau, euler, a.",
    ),
    "unknown register": (
        "qubit[2] q;\nx r[0];\n",
        "program.qasm:2: Unknown register 'r'.\n  Known: q.",
    ),
    "index": (
        "qubit[2] q;\nx q[2];\n",
        "program.qasm:2: Index 2 of q[2] is out of range.\n"
        "  The register has size 2; the last index is 1.",
    ),
    "bit for a qubit": ("qubit q;\nbit c;\nx c;\n", "program.qasm:3: 'c' is a bit, not a qubit."),
    "mid-circuit": (
        "qubit[2] q;\nbit[2] c;\nc = measure q;\nx q[1];\n",
        "program.qasm:4: x q[1] follows the measurement of q[1].\n"
        "  qcompile measures every qubit once, at the end.",
    ),
    "bit written twice": (
        "qubit[2] q;\nbit[2] c;\nc[0] = measure q[0];\nc[0] = measure q[1];\n",
        "program.qasm:4: c[0] is written twice.\n  Measure each qubit into a separate bit.",
    ),
    "measured sizes": (
        "qubit[2] q;\nbit[3] c;\nc = measure q;\n",
        "program.qasm:3: 2 qubits are measured into 3 bits.\n"
        "  A measurement needs one bit per qubit.",
    ),
    "late reset": (
        "qubit q;\nx q;\nreset q;\n",
        "program.qasm:3: reset q comes after a gate or a measurement of its qubit.\n"
        "  qcompile compiles circuits that start in |0>; a reset can only come first.",
    ),
    "unknown name": (
        "input float theta;\nqubit q;\nrx(thta) q;\n",
        "program.qasm:3: Unknown name 'thta'.\n  Did you mean theta?",
    ),
    "not affine": (
        "input float x;\nqubit q;\nrx(x*x) q;\n",
        "program.qasm:3: 'x * x' is not an affine angle.\n  An angle is a number, or a sum of "
        "number*input and numbers, like 0.5*x1+theta2-pi/2.",
    ),
    "sine of an input": (
        "input float x;\nqubit q;\nrx(sin(x)) q;\n",
        "program.qasm:3: 'sin(x)' is not an affine angle.\n  An angle is a number, or a sum of "
        "number*input and numbers, like 0.5*x1+theta2-pi/2.",
    ),
    "division by zero": ("qubit q;\nrx(1/0) q;\n", "program.qasm:2: '1 / 0' divides by zero."),
    "infinite": (
        "qubit q;\nrx(10.0**400) q;\n",
        "program.qasm:2: '10.0 ** 400' is not a finite real number.",
    ),
    "complex": (
        "qubit q;\nrx(sqrt(-1)) q;\n",
        "program.qasm:2: 'sqrt(-1)' is not a finite real number.",
    ),
    "integer division": (
        "const int n = 1;\nqubit q;\nrx(n/2*pi) q;\n",
        "program.qasm:3: 'n / 2' divides whole numbers, which OpenQASM 3 rounds towards zero.\n"
        "  Write one of them with a point, such as 1.0/2.",
    ),
    "exclusive or": (
        "qubit q;\nrx(pi^2) q;\n",
        "program.qasm:2: 'pi ^ 2' is an exclusive or in OpenQASM 3.\n  Write ** for a power.",
    ),
    "if": (
        "qubit q;\nbit c;\nif (c == 1) {\n  x q;\n}\n",
        "program.qasm:3: The statement 'if (c == 1)' is not supported.\n"
        "  qcompile supports gates, barriers, and one measurement of each qubit at the end.",
    ),
    "include": (
        'include "mine.inc";\n',
        "program.qasm:1: Unknown include 'mine.inc'.\n"
        "  Known: stdgates.inc, qelib1.inc, hqslib1.inc. Copy its definitions into this file.",
    ),
    "duration": (
        "qubit q;\nx[2ns] q;\n",
        "program.qasm:2: x q has a duration.\n  Remove it: gates have none here.",
    ),
    "version": (
        "OPENQASM 4.0;\nqubit q;\n",
        "program.qasm:1: Unknown OpenQASM version 4.0.\n  Use 2.0 or 3.0.",
    ),
    "declared twice": ("qubit q;\nbit q;\n", "program.qasm:2: 'q' is declared twice."),
    "recursive gate": (
        "gate g a {\n  x a;\n  g a;\n}\nqubit q;\ng q;\n",
        "program.qasm:3: Gate 'g' is defined by itself.",
    ),
    "huge register": (
        "qubit[1000000000] q;\n",
        "program.qasm:1: Register 'q' has 1000000000 qubits.\n  A program can have 1 to 100000.",
    ),
    "huge power": (
        "qubit q;\npow(1000000000) @ x q;\n",
        "program.qasm:2: The program has more than 1000000 gates after expansion.\n"
        "  Check its nested gate definitions and powers.",
    ),
    "deep": (
        "qubit q;\nrx(" + "(" * 2000 + "1" + ")" * 2000 + ") q;\n",
        "program.qasm:2: The program is nested too deeply.\n"
        "  Split sums in brackets into several const declarations.",
    ),
    "no semicolon": (
        "qubit q\nx q;\n",
        "program.qasm:2: Syntax error at 'x'.\n  Is a ';' missing before it?",
    ),
    "cut off": (
        "qubit q;\nx q",
        "program.qasm:2: The file ends within a statement.\n  Is a ';' or a bracket missing?",
    ),
    "empty": (
        "// nothing\n",
        "program.qasm:1: The file is empty.\n"
        "  A program declares qubits and applies gates to them.",
    ),
    "no qubits": (
        "OPENQASM 3.0;\n",
        "program.qasm:1: The program has no qubits.\n  Declare qubits: qubit[2] q;",
    ),
}


@pytest.mark.parametrize(
    "statement",
    [
        "while (true) { x q; }",
        "extern f(float) -> bit;",
        "box[2.5ns] { x q; }",
        "cal { }",
        "defcal x $0 { }",
        'defcalgrammar "openpulse";',
        "input int n;",
        "end;",
        "{ x q; }",
        "stretch s;",
        "delay[unknown] q;",
        "switch (1) { case 1 { x q; } }",
        "complex z = 1im;",
        "array[int, 2] a = {1, 2};",
        "c[0] = 1;",
        "1 + 1;",
    ],
)
def test_unsupported_statements_are_named(statement):
    with pytest.raises(ProgramFileError) as caught:
        read(f"qubit q;\n{statement}\n", "p")
    first = str(caught.value).splitlines()[0]
    assert first.startswith(f"p:2: The statement {statement.split()[0].rstrip(';')!r}"[:-1])
    assert first.endswith("is not supported.")


def test_barriers_without_end_are_refused(monkeypatch):
    monkeypatch.setattr("qcompile.qasm.interpreter.MAX_MARKED", 2_000)
    read("qubit[50] q;\nfor uint i in [1:40] { barrier q; }\n")
    with pytest.raises(ProgramFileError, match="name more than 2000 qubits in all"):
        read("qubit[50] q;\nfor uint i in [1:900000] { barrier q; }\n")


def test_doubling_definitions_are_refused_before_they_are_written_out():
    gates = [
        "gate g0 a { x a; }",
        *(f"gate g{i} a {{ g{i - 1} a; g{i - 1} a; }}" for i in range(1, 60)),
    ]
    with pytest.raises(ProgramFileError, match="more than 1000000 gates"):
        read("\n".join([*gates, "qubit q;", "g59 q;"]))


VALID = [
    HEAD_3
    + "input float[64] x;\nconst float k = pi/2;\ngate g(a) b, c { rz(a*2) b; inv @ sx c; }\n"
    "qubit[3] q;\nbit[3] c;\nreset q;\nlet r = q[0:1];\ng(x-k) r[0], q[2];\nbarrier q;\n"
    "pow(2) @ t q[1];\nc[0] = measure q[0];\nc[1:2] = measure q[1:2];\n",
    HEAD_2 + "gate f(a) b { u3(a,-pi/2,pi^2) b; }\nqreg q[2];\ncreg c[2];\nf(sin(0.5)) q;\n"
    "sx q[0];\nmeasure q -> c;\n",
    "gate g a { if (true) { x a; } }\nqubit q;\nbit b = measure $0;\ng q;\nint n = 2;\n"
    "box { delay[2ns] q; }\nctrl @ gphase(pi) q;\ngphase(2) ;\n",
    "uint[8] u = 3;\nangle[8] v = pi;\nv = 3*v/2;\nu += 2;\nqubit[2] q;\nbit c;\nreset q;\n"
    "rz(v/2 + u*0.1) q;\npow(0.5) @ U(0.3, v, -v) q[0];\ndelay[10ns] q;\nc = measure q[0];\n"
    "c = measure q[0];\n",
    HEAD_3 + "input float x;\ngate g(a) b, c { cx b, c; ctrl @ ry(a) c, b; gphase(a); }\n"
    "qubit[3] q;\nbit[3] c;\ng(x) q[0], q[1];\nnegctrl @ inv @ g(1) q[2], q[0], q[1];\n"
    "cswap q[0],q[1],q[2];\nbarrier q[0], q[2];\ncz q[0],q[1];\nc = measure q;\n",
]

PIECES = re.split(
    "[|]",
    "(|)|[|]|{|}|;|,|@|=|+|-|*|/|^|:|.|$|#|\"|'|\\|\n| |\x00|\ud800|€|π|q|c|x|g|0|1|-1|1e999|0.5|"
    "99999999999|1im|2ns|inv|pow|ctrl|measure|->|gate|qubit|bit|reset|barrier|let|const|input|"
    "output|float|int|include|cx|gphase|U|sin|sqrt|**|++|array[int, 2]|complex|true|&&|$0|$00|box|"
    "delay|durationof|sizeof|return|pragma|angle[4] v = 0.3;|uint[8] u = -1;|bool(|int[3](|~|!|<<|"
    ">=|%|pow(0.5)@|pow(-1e9)@|ctrl@|rotl(u, 3)|v += |u = |delay[1ns] q;|1e308",
)


def refusal(text: str) -> str | None:
    """The message with which `read` refuses the text; None if it reads it."""
    try:
        source = read(text, "p")
    except ProgramFileError as error:
        return str(error)
    assert len(source.layout) == source.program.bits == len(source.qubits)
    return None


@settings(max_examples=250, deadline=None, derandomize=True)
@given(st.data())
def test_nothing_but_a_program_file_error_escapes(data):
    text = data.draw(st.sampled_from(VALID))
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        end = min(len(text), start + data.draw(st.integers(0, 6)))
        text = text[:start] + data.draw(st.sampled_from(PIECES)) + text[end:]
    assert (refusal(text) or "p:").startswith("p:")


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=60))
@example("9" * 5000)
@example("rz(" + "9" * 5000 + ") $0;")
@example("rz(1" + "+1" * 5000 + ") $0;")
@example("gate g a { reset a; }\ng $0;")
@example("gate g a { x a[0]; }\ng $0;")
@example("let a = 1;")
@example("qubit[2] q; x q[0, 1];")
@example("qubit[1/0] q;")
@example("input float θ; rx(θ) $0;")
@example("$" + "9" * 5000 + ";")
@example("x $" + "9" * 5000 + ";")
def test_any_text_is_read_or_refused(text):
    assert (refusal(text) or "p:").startswith("p:")


def test_a_duration_is_finite():
    with pytest.raises(ProgramFileError, match="is not supported"):
        read("OPENQASM 3.0;\nqubit q;\ndelay[1e999s] q;\n")
