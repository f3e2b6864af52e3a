"""Typed constants and variables have the values of the OpenQASM 3 specification."""

from __future__ import annotations

import math

import numpy as np
import pytest

from qcompile.errors import ProgramFileError
from qcompile.ir import Angle, Circuit
from qcompile.qasm import read
from qcompile.simulate import Simulator

PI = math.pi


def angles(declarations: str, *expressions: str) -> list[float]:
    """The angles of rz gates with these expressions; an angle[n] is in [0, 2 pi)."""
    gates = "".join(f"rz({expression}) q;\n" for expression in expressions)
    source = read(f'OPENQASM 3.0;\ninclude "stdgates.inc";\n{declarations}\nqubit q;\n{gates}')
    return [gate.angle.constant for gate in source.program.circuits[0].gates]


def refusal(declarations: str, *expressions: str) -> str:
    with pytest.raises(ProgramFileError) as caught:
        angles(declarations, *expressions)
    return str(caught.value)


def test_an_angle_is_stored_modulo_a_turn():
    source = read(
        'OPENQASM 3.0;\ninclude "stdgates.inc";\nconst angle[32] a = 2.5*pi;\nqubit q;\nbit c;\n'
        "rx(a/2) q;\nc = measure q;\n"
    )
    z = Simulator(source.program).expectation(np.zeros((1, 0)), np.zeros(0))
    assert z[0, 0] == pytest.approx(math.cos(PI / 4), abs=1e-12)  # not cos(1.25 pi)


SPECIFIED = """
angle[4] a = 7 * (pi / 8);  // "0111"
angle[4] b = pi / 8;        // "0001"
angle[4] c = 5 * (pi / 4);  // "1010"
uint[4] two = 2;
angle[4] d = 9 * (pi / 8);  // "1001"
uint[6] e = 37;             // "100101"
"""


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("a + b", PI),
        ("b - a", 5 * PI / 4),
        ("a / two", 3 * PI / 8),
        ("two * c", PI / 2),
        ("c / b", 10),
        ("-b", 15 * PI / 8),
        ("d << 2", PI / 2),
        ("d >> 2", PI / 4),
        ("d & a", PI / 8),
        ("~a", PI),
        ("popcount(e)", 3),
        ("rotl(e, 3)", 44),
        ("rotr(e, 3)", 44),
    ],
)
def test_arithmetic_of_angles_is_that_of_the_specification(expression, value):
    assert angles(SPECIFIED, expression) == pytest.approx([value], abs=1e-14)


@pytest.mark.parametrize("size", ["", "[53]", "[64]"])
def test_sums_and_products_of_angles_wrap(size):
    declarations = f"angle{size} a = 1.5*pi;\nangle{size} b = -pi/2;"
    values = angles(declarations, "(a + a)/2", "3*a/2", "b/2", "(a + pi)/2", "a + 2.5*pi - a")
    assert values == pytest.approx([PI / 2, PI / 4, 3 * PI / 4, PI / 4, PI / 2], abs=1e-12)


def test_a_cast_to_an_angle_goes_to_the_nearest_with_ties_to_even():
    f = "const float[64] f = 6.283185307179586 * (127. / 512.);"
    assert angles(f, "angle[8](f)", "angle[3](0.39)", "angle[3](0.4)") == [PI / 2, 0, PI / 4]
    wide = "const angle[8] w = 6.283185307179586 * 3 / 256;"
    assert angles(wide, "angle[7](w)", "angle[16](w)") == pytest.approx([PI / 32, 3 * PI / 128])
    assert angles('const bit[4] b = "0100";', "angle[4](b)", "uint[4](b)") == [PI / 2, 4]


def test_an_angle_of_32_bits_has_their_resolution():
    step = 2 * PI / 2**32
    assert angles("angle[32] a = 0.3;", "a") == [pytest.approx(round(0.3 / step) * step, rel=1e-15)]
    assert angles("angle a = 0.3;", "a") == [0.3]


def test_whole_numbers_wrap_where_the_standard_says_so():
    assert angles("uint[8] a = 300;", "a") == [44]
    assert angles("uint[8] a = -1;", "a") == [255]
    assert angles("uint[8] a = 200;\nuint[8] b = 100;", "a + b", "b - a", "a * b") == [44, 156, 32]
    assert angles("uint[8] a = 3;\nuint[8] b = a - 5;", "b") == [254]
    assert angles("const int[8] a = int[8](uint[8](200));", "a", "uint[8](a)") == [-56, 200]
    assert angles("int a = 7/2;\nint b = -7/2;\nint c = -7 % 3;", "a", "b", "c") == [3, -3, -1]
    assert angles("int a = int(-2.9);", "a", "int(2.9)", "mod(7, 4)", "2**10") == [-2, 2, 3, 1024]


def test_floats_of_32_bits_are_rounded():
    one = float(np.float32(0.1))
    both = float(np.float32(0.1) + np.float32(0.2))
    declarations = "float[32] a = 0.1;\nfloat[32] b = 0.2;"
    assert angles(declarations, "a", "a + b", "float[32](pi)") == [one, both, float(np.float32(PI))]
    assert angles("float[32] a = 0.1;", "a + 0.2") == [one + 0.2]


def test_truth_values_are_0_and_1():
    declarations = "const bool a = true;\nbit b = 0;\nbool c = 2 > 3 || !a;"
    assert angles(declarations, "a*pi", "c*pi", "float(a && pi > 3)") == [PI, 0, 1]


def test_variables_have_the_value_that_they_were_last_given():
    declarations = "float a = 0.3;\nint n;\na = 0.4;\nn = 3;\na *= n;\nn -= 1;\nangle[8] t = pi;"
    assert angles(declarations + "\nt += 1.5*pi;", "a", "n", "t") == [0.4 * 3, 2, PI / 2]
    source = read(
        "input float x;\nqubit q;\nfloat a = 2*x;\nrx(a) q;\na = a + x - 1;\nrx(a/2) q;\n"
    )
    assert source.program.circuits == (Circuit.parse("rx(2*x) rx(1.5*x-0.5)"),)


def test_the_parameters_of_a_gate_are_real_numbers():
    gate = "gate g(t) a { rz(t/2) a; }\nconst angle[32] w = 2.5*pi;"
    source = read(f'include "stdgates.inc";\n{gate}\nqubit q;\ng(2.5*pi) q;\ng(w) q;\n')
    found = [gate.angle for gate in source.program.circuits[0].gates]
    assert found == [Angle(1.25 * PI), Angle(PI / 4)]
