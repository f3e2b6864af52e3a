"""Reading OpenQASM: meaning against Qiskit's own readers, and the exact texts of refusals."""

from __future__ import annotations

import math
import random
import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from qcompile.errors import ProgramFileError
from qcompile.ir import FIXED_GATES, ROTATION_GATES, Circuit, Program
from qcompile.qasm import Layout, Register, Source, read, read_file
from qcompile.simulate import Simulator

qiskit_qasm2 = pytest.importorskip("qiskit.qasm2")
qiskit_qasm3 = pytest.importorskip("qiskit.qasm3")

HEAD_3 = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
HEAD_2 = 'OPENQASM 2.0;\ninclude "qelib1.inc";\n'


def expectations(source: Source) -> np.ndarray:
    return Simulator(source.program).expectation(np.zeros((1, 0)), np.zeros(0))[0]


def qiskit_expectations(circuit) -> np.ndarray:
    from qiskit.quantum_info import Pauli, Statevector

    circuit.remove_final_measurements()
    state = Statevector(circuit)
    return np.array(
        [state.expectation_value(Pauli("Z"), [i]).real for i in range(state.num_qubits)]
    )


def circuits(*texts: str) -> tuple[Circuit, ...]:
    return tuple(map(Circuit.parse, texts))


# A probe rotation before and after makes <Z> depend on the axis and the sense of each gate.
def probed(gate: str) -> str:
    return f"ry(0.7) q[0];\nrz(0.4) q[0];\n{gate}\nrz(1.1) q[0];\nry(0.3) q[0];\n"


GATES = [
    *(f"{name} q[0];" for name in FIXED_GATES),
    *(f"{name}(0.6) q[0];" for name in ROTATION_GATES),
    "u1(0.6) q[0];",
    "u2(0.6, -1.3) q[0];",
    "u3(0.6, -1.3, 2.2) q[0];",
    "U(0.6, -1.3, 2.2) q[0];",
    "rx(-3*pi/4) q[0];",
    "rx(-(pi+1)/3) q[0];",
]


@pytest.mark.parametrize("gate", GATES)
def test_openqasm_2_gates_mean_what_qiskit_reads(gate):
    text = HEAD_2 + "qreg q[1];\n" + probed(gate)
    legacy = qiskit_qasm2.LEGACY_CUSTOM_INSTRUCTIONS
    theirs = qiskit_expectations(qiskit_qasm2.loads(text, custom_instructions=legacy))
    np.testing.assert_allclose(expectations(read(text)), theirs, atol=1e-9)


@pytest.mark.parametrize("expression", ["sin(pi/8)^2", "2*pi^2", "-pi^2", "ln(3)+sqrt(2)*1/2"])
def test_openqasm_2_expressions_mean_what_qiskit_reads(expression):
    test_openqasm_2_gates_mean_what_qiskit_reads(f"rx({expression}) q[0];")


@pytest.mark.parametrize(
    "gate",
    [
        *(g for g in GATES if not g.startswith("sxdg")),
        "phase(0.6) q[0];",
        "inv @ sx q[0];",
        "inv @ u3(0.6, -1.3, 2.2) q[0];",
        "pow(3) @ t q[0];",
        "pow(-2) @ inv @ rx(0.4) q[0];",
        "inv @ pow(2) @ s q[0];",
        "gphase(0.3);",
    ],
)
def test_openqasm_3_gates_mean_what_qiskit_reads(gate):
    text = HEAD_3 + "qubit[1] q;\n" + probed(gate)
    theirs = qiskit_expectations(qiskit_qasm3.loads(text))
    np.testing.assert_allclose(expectations(read(text)), theirs, atol=1e-9)


def test_own_gates_on_two_qubits_and_broadcasts_mean_what_qiskit_reads():
    text = HEAD_3 + (
        "gate turn(a, b) c { rz(a+b/2) c; sx c; }\n"
        "gate pair(a) c, d { turn(a, 0.5) c; h d; barrier c, d; inv @ turn(2*a, a) d; }\n"
        "qubit[2] q;\nqubit[2] r;\nqubit t1;\n"
        "h q;\npair(0.3) q, r;\npair(0.7) t1, q[1];\nbarrier q, r[0];\npow(2) @ pair(0.1) r, q;\n"
        "ry(0.4) q;\nrx(1.0) r;\nry(0.2) t1;\n"
    )
    theirs = qiskit_expectations(qiskit_qasm3.loads(text))
    np.testing.assert_allclose(expectations(read(text)), theirs, atol=1e-9)


def test_r_turns_about_an_axis_in_the_plane():
    from qiskit import QuantumCircuit

    text = HEAD_2 + "qreg q[1];\n" + probed("r(0.6,-1.3) q[0];")
    theirs = QuantumCircuit(1)
    theirs.ry(0.7, 0)
    theirs.rz(0.4, 0)
    theirs.r(0.6, -1.3, 0)
    theirs.rz(1.1, 0)
    theirs.ry(0.3, 0)
    np.testing.assert_allclose(expectations(read(text)), qiskit_expectations(theirs), atol=1e-9)


def test_a_file_of_qiskit_is_read():
    from qiskit import QuantumCircuit

    rng = random.Random(5)
    circuit = QuantumCircuit(4)
    for _ in range(40):
        name = rng.choice(["h", "sx", "sxdg", "t", "rx", "ry", "p", "x"])
        qubit = rng.randrange(4)
        angle = [rng.uniform(-4, 4)] if name in ROTATION_GATES else []
        getattr(circuit, name)(*angle, qubit)
    expected = qiskit_expectations(circuit.copy())
    circuit.measure_all()
    for text in (qiskit_qasm2.dumps(circuit), qiskit_qasm3.dumps(circuit)):
        source = read(text)
        np.testing.assert_allclose(expectations(source), expected, atol=1e-9)
        assert source.layout.bits == tuple(("meas", i) for i in range(4))


def test_inputs_constants_and_expressions_are_affine():
    source = read(
        "OPENQASM 3.0;\ninput float[64] x;\ninput angle theta;\nconst float k = 2*cos(0);\n"
        "const int n = 4;\nqubit q;\n"
        "rx(k*x - theta/n + n/2) q;\nrz(-(x + 1.5e0) * 2 + tau - 2*pi + 2**3 + euler - euler) q;\n"
    )
    assert source.program == Program(circuits("rx(2*x-0.25*theta+2) rz(-2*x+5)"), ("x", "theta"))


def test_registers_bits_and_physical_qubits_are_kept():
    source = read(
        "qubit a;\nqubit[2] b;\nbit[3] c;\nbit d = measure a;\nx $7;\nc[2] = measure b[0];\n"
        "c[0:0] = measure b[1:1];\nmeasure $7;\n"
    )
    assert source == Source(
        Program(circuits("", "", "", "x")),
        Layout(
            (Register("a", None), Register("b", 2)),
            (Register("c", 3), Register("d", None)),
            (("a", 0), ("b", 0), ("b", 1), 7),
            (("d", 0), ("c", 2), ("c", 0), None),
        ),
    )


def test_slices_aliases_and_negative_indices_name_qubits():
    source = read(
        "qubit[5] q;\nlet even = q[0:2:4];\nlet both = even[{0, 2}] ++ q[1:1];\n"
        "x even;\ny both[-1];\nz q[-1];\nh q[3:-1:2];\n"
    )
    assert source.program.circuits == circuits("x", "y", "x h", "h", "x z")


def test_broadcast_measurement_of_openqasm_2():
    source = read(HEAD_2 + "qreg q[2];\ncreg c[2];\nreset q;\nx q;\nbarrier q;\nmeasure q -> c;\n")
    assert source.program.circuits == circuits("x", "x")
    assert source.layout == Layout.default(2)


def test_a_gate_the_file_defines_hides_the_table():
    source = read(HEAD_2 + "gate sx a { h a; }\nqreg q[1];\nsx q[0];\n")
    assert source.program.circuits == circuits("h")


REFUSED = {
    "entangling": (
        HEAD_3 + "qubit[2] q;\nbit[2] c;\nh q;\n// comment\ncx q[0],q[1];\n",
        "program.qasm:7: cx q[0], q[1] entangles two qubits.\n"
        "  qcompile compiles circuits without entangling gates; this one has 1.\n"
        "  Compile it with Qiskit's transpile, or remove the gate.",
    ),
    "all entangling gates are counted": (
        "gate bell a, b { h a; CX a, b; }\nqubit[3] q;\nbell q[0], q[1];\nctrl @ x q[0], q[1];\n"
        "ccx q[0], q[1], q[2];\n",
        "program.qasm:3: bell q[0], q[1] entangles two qubits.\n"
        "  qcompile compiles circuits without entangling gates; this one has 3.\n"
        "  Compile it with Qiskit's transpile, or remove the gate.",
    ),
    "swap": (
        "qubit[2] q;\nswap q[0], q[1];\n",
        "program.qasm:2: swap q[0], q[1] exchanges two qubits.\n"
        "  qcompile compiles circuits without entangling gates; this one has 1.\n"
        "  Compile it with Qiskit's transpile, or remove the gate.",
    ),
    "unknown gate": (
        "qubit q;\nsxgd q;\n",
        "program.qasm:2: Unknown gate 'sxgd'.\n  Did you mean sxdg or sx or sdg?",
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
        "program.qasm:2: Index 2 of q[2] is out of range.\n  The register has 2, the last is 1.",
    ),
    "bit for a qubit": ("qubit q;\nbit c;\nx c;\n", "program.qasm:3: 'c' is a bit, not a qubit."),
    "mid-circuit": (
        "qubit[2] q;\nbit[2] c;\nc = measure q;\nx q[1];\n",
        "program.qasm:4: x q[1] follows the measurement of q[1].\n"
        "  qcompile measures every qubit once, at the end.",
    ),
    "measured twice": (
        "qubit q;\nbit[2] c;\nc[0] = measure q;\nc[1] = measure q;\n",
        "program.qasm:4: q is measured twice.\n  qcompile measures every qubit once, at the end.",
    ),
    "bit written twice": (
        "qubit[2] q;\nbit[2] c;\nc[0] = measure q[0];\nc[0] = measure q[1];\n",
        "program.qasm:4: c[0] is written twice.\n  Measure every qubit into a bit of its own.",
    ),
    "measured sizes": (
        "qubit[2] q;\nbit[3] c;\nc = measure q;\n",
        "program.qasm:3: 2 qubits are measured into 3 bits.\n"
        "  A measurement needs one bit for each qubit.",
    ),
    "late reset": (
        "qubit q;\nx q;\nreset q;\n",
        "program.qasm:3: reset q comes after a gate or a measurement of its qubit.\n"
        "  qcompile compiles circuits that start in |0>; a reset can only come first.",
    ),
    "unknown name": (
        "input float theta;\nqubit q;\nrx(thta) q;\n",
        "program.qasm:3: Unknown name 'thta'.\n  Did you mean theta or tau?",
    ),
    "not affine": (
        "input float x;\nqubit q;\nrx(x*x) q;\n",
        "program.qasm:3: 'x * x' is no affine angle.\n  An angle is a number, or a sum of "
        "number*input and numbers, like 0.5*x1+theta2-pi/2.",
    ),
    "sine of an input": (
        "input float x;\nqubit q;\nrx(sin(x)) q;\n",
        "program.qasm:3: 'sin(x)' is no affine angle.\n  An angle is a number, or a sum of "
        "number*input and numbers, like 0.5*x1+theta2-pi/2.",
    ),
    "division by zero": ("qubit q;\nrx(1/0) q;\n", "program.qasm:2: '1 / 0' divides by zero."),
    "infinite": (
        "qubit q;\nrx(10.0**400) q;\n",
        "program.qasm:2: '10.0 ** 400' is no finite real number.",
    ),
    "complex": (
        "qubit q;\nrx(sqrt(-1)) q;\n",
        "program.qasm:2: 'sqrt(-1)' is no finite real number.",
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
        "  qcompile reads gates, barriers, and one measurement of each qubit at the end.",
    ),
    "delay": (
        "qubit q;\ndelay[10ns] q;\n",
        "program.qasm:2: The statement 'delay[10.0ns] q' is not supported.\n"
        "  qcompile reads gates, barriers, and one measurement of each qubit at the end.",
    ),
    "include": (
        'include "mine.inc";\n',
        "program.qasm:1: The include 'mine.inc' is not known.\n"
        "  Known: stdgates.inc and qelib1.inc. Copy what it defines into this file.",
    ),
    "duration": (
        "qubit q;\nx[2ns] q;\n",
        "program.qasm:2: x q has a duration.\n  Gates take none here.",
    ),
    "version": (
        "OPENQASM 4.0;\nqubit q;\n",
        "program.qasm:1: OpenQASM 4.0 is not known.\n  Known versions: 2.0 and 3.0.",
    ),
    "declared twice": ("qubit q;\nbit q;\n", "program.qasm:2: 'q' is declared twice."),
    "recursive gate": (
        "gate g a {\n  x a;\n  g a;\n}\nqubit q;\ng q;\n",
        "program.qasm:3: Gate 'g' is defined by itself.",
    ),
    "huge register": (
        "qubit[1000000000] q;\n",
        "program.qasm:1: Register 'q' has 1000000000 qubits.\n"
        "  A program can have 1 to 100000 of them.",
    ),
    "huge power": (
        "qubit q;\npow(1000000000) @ x q;\n",
        "program.qasm:2: The program has more than 1000000 gates when it is written out.\n"
        "  Check its nested gate definitions and powers.",
    ),
    "deep": (
        "qubit q;\nrx(" + "(" * 2000 + "1" + ")" * 2000 + ") q;\n",
        "program.qasm:1: The program is nested too deeply.\n"
        "  Write long sums and brackets as several const declarations.",
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
        "program.qasm:1: The program has no qubits.\n  Declare some, such as: qubit[2] q;",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_say_where_what_and_what_to_do(case, capsys):
    text, message = REFUSED[case]
    with pytest.raises(ProgramFileError) as caught:
        read(text, "program.qasm")
    assert str(caught.value) == message
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "statement",
    [
        "for uint i in [0:3] { x q; }",
        "while (true) { x q; }",
        "def f(qubit a) { x a; }",
        "extern f(float) -> bit;",
        "box { x q; }",
        "cal { }",
        "defcal x $0 { }",
        'defcalgrammar "openpulse";',
        "pragma user thing",
        "int n = 3;",
        "input int n;",
        'bit c = "0";',
        "end;",
        "{ x q; }",
        "stretch s;",
        "switch (1) { case 1 { x q; } }",
        "ctrl @ gphase(1) q;",
        "1 + 1;",
    ],
)
def test_unsupported_statements_are_named(statement):
    with pytest.raises(ProgramFileError) as caught:
        read(f"qubit q;\n{statement}\n", "p")
    first = str(caught.value).splitlines()[0]
    assert first.startswith(f"p:2: The statement {statement.split()[0].rstrip(';')!r}"[:-1])
    assert first.endswith("is not supported.")


def test_doubling_definitions_are_refused_before_they_are_written_out():
    gates = [
        "gate g0 a { x a; }",
        *(f"gate g{i} a {{ g{i - 1} a; g{i - 1} a; }}" for i in range(1, 60)),
    ]
    with pytest.raises(ProgramFileError, match="more than 1000000 gates"):
        read("\n".join([*gates, "qubit q;", "g59 q;"]))


def test_files(tmp_path):
    path = tmp_path / "good.qasm"
    path.write_text("\N{ZERO WIDTH NO-BREAK SPACE}qubit q;\nx q;\n", encoding="utf-8")
    assert read_file(path).program.circuits == circuits("x")
    with pytest.raises(ProgramFileError) as caught:
        read_file(tmp_path / "missing.qasm")
    assert str(caught.value) == (
        f"{tmp_path}/missing.qasm: The file cannot be read: No such file or directory.\n"
        "  Give the path of an OpenQASM 2 or 3 program."
    )
    path.write_bytes(b"\xff\xfe\x00x")
    with pytest.raises(ProgramFileError, match=r"good\.qasm: The file is not text"):
        read_file(str(path))
    path.write_text("qubit q;\nnope q;\n")
    with pytest.raises(ProgramFileError, match=r"good\.qasm:2: Unknown gate 'nope'"):
        read_file(path)


VALID = [
    HEAD_3
    + "input float[64] x;\nconst float k = pi/2;\ngate g(a) b, c { rz(a*2) b; inv @ sx c; }\n"
    "qubit[3] q;\nbit[3] c;\nreset q;\nlet r = q[0:1];\ng(x-k) r[0], q[2];\nbarrier q;\n"
    "pow(2) @ t q[1];\nc[0] = measure q[0];\nc[1:2] = measure q[1:2];\n",
    HEAD_2 + "gate f(a) b { u3(a,-pi/2,pi^2) b; }\nqreg q[2];\ncreg c[2];\nf(sin(0.5)) q;\n"
    "sx q[0];\nmeasure q -> c;\n",
    "gate g a { if (true) { x a; } }\nqubit q;\nbit b = measure $0;\ng q;\nint n = 2;\n"
    "box { delay[2ns] q; }\nctrl @ gphase(pi) q;\ngphase(2) ;\n",
]
PIECES = re.split(
    "[|]",
    "(|)|[|]|{|}|;|,|@|=|+|-|*|/|^|:|.|$|#|\"|'|\\|\n| |\x00|\ud800|€|π|q|c|x|g|0|1|-1|1e999|0.5|"
    "99999999999|1im|2ns|inv|pow|ctrl|measure|->|gate|qubit|bit|reset|barrier|let|const|input|"
    "output|float|int|include|cx|gphase|U|sin|sqrt|**|++|array[int, 2]|complex|true|&&|$0|$00|box|"
    "delay|durationof|sizeof|return|pragma",
)


def refusal(text: str) -> str | None:
    """The message with which `read` refuses the text; None if it reads it."""
    try:
        source = read(text, "p")
    except ProgramFileError as error:
        return str(error)
    assert len(source.layout) == len(source.program)
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


def test_an_angle_reads_back_exactly():
    rng = random.Random(3)
    values = [rng.uniform(-7, 7) for _ in range(50)] + [k * math.pi / 16 for k in range(-40, 40)]
    text = "".join(f"rz({value!r}) $0;\n" for value in values)
    read_back = [gate.angle.constant for gate in read(text).program.circuits[0].gates]
    assert read_back == values
