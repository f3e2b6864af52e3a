"""Loops and subroutines with known values, compared with their expansions."""

from __future__ import annotations

import pytest

from qcompile.errors import ProgramFileError
from qcompile.ir import Circuit
from qcompile.qasm import read

HEAD = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'


def circuits(text: str) -> list[str]:
    return [str(circuit) for circuit in read(HEAD + text).program.circuits]


def refused(text: str) -> str:
    with pytest.raises(ProgramFileError) as caught:
        read(HEAD + text, "p")
    return str(caught.value)


@pytest.mark.parametrize(
    ("values", "indices"),
    [("[0:2]", [0, 1, 2]), ("[2:-2:0]", [2, 0]), ("[0:2:3]", [0, 2]), ("{3, 1}", [3, 1]),
     ("[1:0]", []), ("[n:n]", [1])],
)  # fmt: skip
def test_a_loop_over_qubits(values, indices):
    found = circuits(f"const int n = 1;\nqubit[4] q;\nfor uint i in {values} {{ h q[i]; }}\n")
    assert found == ["h" if i in indices else "" for i in range(4)]


def test_loops_nest_and_their_values_are_numbers():
    text = (
        "input float x;\nqubit[2] q;\nint total = 0;\nfor int i in [1:2] {\n  float half = i/2.0;\n"
        "  for int j in {0, 1} ry(half*j) q[j];\n  rz(i*x) q[0];\n  total += i;\n}\n"
        "for int i in [0:0] rx(total) q[i];\n"
    )
    assert circuits(text) == ["ry(0.0) rz(x) ry(0.0) rz(2.0*x) rx(3.0)", "ry(0.5) ry(1.0)"]


def test_a_condition_on_known_values_chooses_a_side():
    text = "qubit[3] q;\nfor uint i in [0:2] { if (i == 1) x q[i]; else { h q[i]; } }\n"
    assert circuits(text) == ["h", "x", "h"]
    text = "qubit q;\nbit c;\nc = measure q;\nif (c == 1) x q;\n"
    assert refused(text).startswith("p:6: The statement 'if (c == 1)' is not supported.")


def test_a_subroutine_has_its_own_names():
    text = (
        "const float k = 0.5;\nfloat t = 9;\n"
        "def inner(qubit a) { h a; }\n"
        "def turn(qubit[2] q, float t, uint n) {\n  let a = q[1];\n  inner(a);\n"
        "  for uint i in [1:n] rx(k*t) q[0];\n}\n"
        "qubit a;\nqubit[3] q;\nturn(q[0:1], 0.2, 2);\nturn(q[{2, 0}], 1, 1);\nrx(t) a;\n"
    )
    assert circuits(text) == ["rx(9.0)", "rx(0.1) rx(0.1) h", "h", "rx(0.5)"]


def test_a_subroutine_that_is_not_called_matters_to_nobody():
    text = "def f(creg c[3]) { }\ndef g(qubit a) -> bit { return measure a; }\nqubit q;\nx q;\n"
    assert circuits(text) == ["x"]


def test_a_box_is_its_statements():
    assert circuits("qubit q;\nbox {\n  h q;\n  x q;\n}\n") == ["h x"]


def test_the_gates_of_a_loop_are_limited():
    text = "qubit[1000] q;\nfor uint i in [0:999999] { x q; }\n"
    assert "more than 1000000 gates" in refused(text)


def test_a_loop_equals_its_expansion():
    loop = read(HEAD + "qubit[3] q;\nfor uint i in [0:2] { rx(i*pi/4) q[i]; sdg q; }\n")
    lines = "".join(f"rx({i}*pi/4) q[{i}];\nsdg q;\n" for i in range(3))
    assert loop.program == read(f"{HEAD}qubit[3] q;\n{lines}").program
    assert loop.program.circuits[0] == Circuit.parse("rx(0.0) sdg sdg sdg")


def test_a_constant_of_a_block_hides_that_of_the_file_there_alone():
    text = (
        "input float x;\nconst float c = 1;\nqubit[3] q;\ngate g a { rz(c) a; }\n"
        "def f(qubit a) {\n  const float c = 2;\n  const float x = 4;\n"
        "  ry(c) a;\n  ry(x) a;\n  g a;\n}\n"
        "f(q[0]);\nrx(c) q[1];\nrx(x) q[2];\n"
    )
    assert circuits(text) == ["ry(2.0) ry(4.0) rz(1.0)", "rx(1.0)", "rx(x)"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "gate g a {\n  rz(c) a;\n}\nqubit q;\nfor int i in [1:2] { const int c = i; g q; }\n",
            "p:4: Unknown name 'c'.",
        ),
        (
            "float v = 1;\nqubit q;\ndef f(qubit a) {\n  v = 2;\n  rz(v) a;\n}\nf(q);\n",
            "p:6: 'v' is not a variable.",
        ),
        (
            "qubit q;\nfor int i in [1:2] {\n  const int c = i;\n  c = 3;\n}\n",
            "p:6: 'c' is not a variable.",
        ),
    ],
)
def test_names_of_a_block_are_not_those_of_the_file(text, message):
    assert refused(text).startswith(message)
