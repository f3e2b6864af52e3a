"""The fast path agrees with the full parser, bit for bit, errors and lines included."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from qasm.test_read_refusals import PIECES, REFUSED, VALID

from qcompile.errors import CircuitError
from qcompile.ir import FIXED_GATES, ROTATION_GATES
from qcompile.qasm import read
from qcompile.qasm.reader import Reader
from qcompile.qasm.work import MAX_GATES

HEAD_3 = 'OPENQASM 3.0;\ninclude "stdgates.inc";\n'
HEAD_2 = 'OPENQASM 2.0;\ninclude "qelib1.inc";\n'


TWO = ("cx", "cz", "swap", "crz", "rzz", "both")
OTHERS = {"u3": 3, "u2": 2, "u1": 1, "turn": 1, "crz": 1, "rzz": 1, "both": 1}
OTHERS |= dict.fromkeys(("cx", "cz", "swap", "ccx", "nope"), 0)
OPERANDS = ["q[0]", "q[1]", "q[2]", "q[02]", "q", "p", "$4", "q[3]", "r", "q[0:1]"]


def outcome(text: str, *, fast: bool) -> object:
    reader = Reader(text, fast=fast)
    try:
        return reader.run()
    except CircuitError as error:
        return reader.line, str(error)
    except RecursionError:
        return "nested too deeply"


def program(rng: random.Random, version: str) -> str:
    """A random program of statements that the fast path takes, and of some that it does not."""
    if version == "3":
        lines = [HEAD_3 + "input float[64] x;", "qubit[3] q;", "qubit p;", "bit[3] c;"]
    else:
        lines = [HEAD_2 + "qreg q[3];", "qreg p[1];", "creg c[3];"]
    lines.append("gate turn(a) b { rx(a/2) b; h b; }")
    numbers = ["0.5", "-1", "1e-3", ".25", "3.", "007", "-0", "12345678901234567890", "1e400"]
    texts = ["pi/2", "-pi", "2*(pi-1)", "sin(0.3)", "-pi/3+0.1", "1/3", "pi//\n/2"]
    texts += ["x", "0.5*x-1", "k"] if version == "3" else ["2^3", "pi^2"]
    lines.append("gate both(a) b, d { cx b, d; rx(a) d; barrier b, d; h b; }")
    for index in range(rng.randrange(40)):
        name = rng.choice([*FIXED_GATES, *ROTATION_GATES, *OTHERS])
        count = OTHERS.get(name, int(name in ROTATION_GATES))
        count += rng.random() < 0.02
        angles = [rng.choice(numbers if rng.random() < 0.6 else texts) for _ in range(count)]
        blank = rng.choice(["", "", "", " ", "\n", "  // why\n", "/* ; */"])
        head = f"{name}({blank.join([',']).join(angles)})" if angles else name
        width = 1 + (rng.random() < (0.9 if name in TWO else 0.02))
        operands = [rng.choice(OPERANDS if rng.random() < 0.3 else OPERANDS[:3])]
        operands += rng.sample(OPERANDS[:3], width - 1)
        operand = f"{blank},{blank}".join(operands)
        lines.append(f"{blank}{head} {blank}{operand}{blank};" if rng.random() > 0.02 else head)
        if version == "3" and rng.random() < 0.1:
            lines.append(rng.choice([f"const float k = {index};", "barrier q;", "inv @ s q[0];"]))
        if rng.random() < 0.03:
            lines.append(rng.choice(["measure q[0] -> c[0];", "reset p;"]))
    return rng.choice(["\n", "\n", " "]).join(lines) + "\n"


@pytest.mark.parametrize("seed", range(150))
@pytest.mark.parametrize("version", ["3", "2"])
def test_random_programs(seed, version):
    text = program(random.Random(seed), version)
    assert outcome(text, fast=True) == outcome(text, fast=False)


@pytest.mark.parametrize("text", [*VALID, *(text for text, _ in REFUSED.values())])
def test_the_programs_of_other_tests(text):
    assert outcome(text, fast=True) == outcome(text, fast=False)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.data())
def test_broken_programs(data):
    text = program(random.Random(data.draw(st.integers(0, 50))), data.draw(st.sampled_from("32")))
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        text = text[:start] + data.draw(st.sampled_from(PIECES)) + text[start + 1 :]
    assert outcome(text, fast=True) == outcome(text, fast=False)


def test_a_gate_that_the_file_defines_later_is_not_looked_up_as_the_old_one():
    text = HEAD_3 + "qubit q;\nfloat a = 1;\nrx(a) q;\na = 2;\nrx(a) q;\n"
    assert str(read(text).program.circuits[0]) == "rx(1.0) rx(2.0)"


def test_equal_gates_are_one_object():
    (circuit,) = read(HEAD_3 + "qubit q;\n" + "rx(0.5) q;\n" * 3).program.circuits
    assert circuit.gates[0] is circuit.gates[1] is circuit.gates[2]


def test_the_limit_of_gates_counts_each_once():
    lines = [HEAD_3 + "qubit[1000] q;", *["x q;"] * (MAX_GATES // 1000)]
    assert len(read("\n".join(lines)).program.circuits[7]) == MAX_GATES // 1000
    reader = Reader("\n".join([*lines, "barrier q;", "h q[3];"]))
    with pytest.raises(CircuitError, match=f"more than {MAX_GATES} gates"):
        reader.run()
    assert reader.line == 3 + MAX_GATES // 1000 + 2


@pytest.mark.parametrize("blank", ["\x1f", "\x0b", "\u2003", "\t", "\r\n"])
def test_characters_that_pass_for_blanks_in_python_alone_change_nothing(blank):
    text = f"{HEAD_2}qreg q[1];\nrz(0.{blank}) q[0];\n"
    assert outcome(text, fast=True) == outcome(text, fast=False)
