"""Circuits drawn as text, SVG and LaTeX."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import pytest

from qcompile.device import load_device
from qcompile.errors import FigureError
from qcompile.ir import Circuit, Program
from qcompile.passes import compile
from qcompile.report.drawing import draw_executable, form_of

SVG = "{http://www.w3.org/2000/svg}"


def program(*texts: str, inputs: int = 2, parameters: int = 2) -> Program:
    return Program.of(map(Circuit.parse, texts), inputs, parameters)


TWO = program("h ry(x0) rz(theta0)", "sx rx(-0.5*x1+pi/2)")
ALIKE = program("ry(x0)", "ry(x1)", "h", "ry(theta0)", "ry(x0)", "ry(x1)")


def test_text_has_a_line_for_each_wire_and_columns_below_each_other() -> None:
    assert TWO.draw() == (
        "circuit 0  |0>─ h ── ry(x0) ─────────── rz(theta0) ─ M\n"
        "circuit 1  |0>─ sx ─ rx(-0.5*x1+pi/2) ────────────── M\n"
    )


def test_latex_is_an_environment_of_quantikz() -> None:
    assert TWO.draw("latex") == (
        "% needs \\usepackage{tikz} and \\usetikzlibrary{quantikz2}\n"
        "\\begin{quantikz}\n"
        "\\lstick{circuit 0: $\\ket{0}$} & \\gate{H} & \\gate{R_{y}(x_{0})} & "
        "\\gate{R_{z}(\\theta_{0})} & \\meter{} \\\\\n"
        "\\lstick{circuit 1: $\\ket{0}$} & \\gate{\\sqrt{X}} & "
        "\\gate{R_{x}(-0.5 x_{1} + \\pi/2)} & \\qw & \\meter{}\n"
        "\\end{quantikz}\n"
    ).replace("\\pi/2", "\\pi /2")


@pytest.mark.parametrize(
    ("gate", "latex"),
    [
        ("id", "I"),
        ("sdg", "S^{\\dagger}"),
        ("sxdg", "\\sqrt{X}^{\\dagger}"),
        ("p(3*pi/4)", "P(3\\pi /4)"),
        ("rz(-0.000012345)", "R_{z}(-1.234\\cdot 10^{-5})"),
        ("rz(x0-theta1)", "R_{z}(-\\theta_{1} + x_{0})"),
        ("rz(0)", "R_{z}(0)"),
    ],
)
def test_gates_as_papers_write_them(gate: str, latex: str) -> None:
    drawn = program(gate).draw("latex")
    assert f"& \\gate{{{latex}}} &" in drawn
    assert drawn.count("{") == drawn.count("}")


def test_names_of_several_letters_stand_upright_and_are_escaped() -> None:
    named = Program((Circuit.parse("rz(my_angle) rz(y_12)"),), ("my_angle", "y_12"))
    assert "\\gate{R_{z}(\\textrm{my\\_angle})} & \\gate{R_{z}(y_{12})}" in named.draw("latex")


def shown(drawn: str) -> list[str]:
    """The words of an SVG, piece by piece."""
    root = ElementTree.fromstring(drawn)
    assert root.tag == f"{SVG}svg"
    return ["".join(node.itertext()).replace("\u200b", "") for node in root.iter(f"{SVG}text")]


def test_svg_has_a_box_for_each_gate_and_no_colour_of_its_own() -> None:
    drawn = TWO.draw("svg")
    root = ElementTree.fromstring(drawn)
    assert len([*root.iter(f"{SVG}rect")]) == 3 + 2 + 2, "gates and two dials"
    assert shown(drawn)[1:4] == ["H", "Ry(x0)", "Rz(θ0)"]
    assert root.get("role") == "img"
    assert root.get("aria-label") == "Circuits"
    assert root.get("stroke") == "currentColor"
    assert "#" not in drawn.replace("&#8203;", "")


def test_nothing_in_an_svg_lies_outside() -> None:
    root = ElementTree.fromstring(TWO.draw("svg"))
    width, height = float(root.get("width", 0)), float(root.get("height", 0))
    for box in root.iter(f"{SVG}rect"):
        x, y, wide, high = (float(box.get(name, 0)) for name in ("x", "y", "width", "height"))
        assert 0 < x < x + wide < width
        assert 0 < y < y + high < height


def test_one_circuit_of_each_shape_is_drawn() -> None:
    drawn = ALIKE.draw()
    assert [line.split()[:2] for line in drawn.splitlines()[:3]] == [
        ["circuit", "0"],
        ["circuit", "2"],
        ["circuit", "3"],
    ], "theta0 is a parameter: its circuit is of another shape"
    assert drawn.splitlines()[3] == "circuit 0 stands for 4 circuits of its shape: 0, 1, 4, 5"


def test_one_circuit_alone() -> None:
    assert ALIKE.draw(circuit=4) == "circuit 4  |0>─ ry(x0) ─ M\n"
    with pytest.raises(
        FigureError, match=r"^There is no circuit 6\.\n  There are circuits 0 to 5\.$"
    ):
        ALIKE.draw(circuit=6)


def test_before_and_after_compilation() -> None:
    executable = compile(program("ry(x0)", "ry(x1)"), load_device("ibm_lima"), 2)
    before, after = executable.draw().split("\n\n")
    assert before == "before\ncircuit 0  |0>─ ry(x0) ─ M"
    title, wire, *notes = after.splitlines()
    assert title == "after, for ibm_lima, level 2"
    assert wire == f"circuit 0, qubit {executable.qubits[0]}  |0>─ sx ─ rz(x0+pi) ─ sx ─ M"
    assert notes == ["circuit 0 stands for 2 circuits of its shape: 0, 1"]
    assert "before; after, for ibm_lima, level 2" in executable.draw("svg")
    assert executable.draw("latex").count("\\begin{quantikz}") == 2


def test_angles_that_are_computed_when_bound_are_said() -> None:
    executable = compile(program("h ry(x0) rz(x1) ry(theta0)"), load_device("ideal"), 2)
    note = executable.draw().splitlines()[-1]
    assert note.startswith("polar0 = polar{")
    assert f"% {note}" in executable.draw("latex").splitlines()
    assert note in shown(executable.draw("svg"))


def test_circuits_have_the_numbers_that_they_are_called_by() -> None:
    executable = compile(program("h", "x"), load_device("ideal"), 0)
    drawn = draw_executable(executable, circuit=7, numbers=[5, 7])
    assert "circuit 7  |0>─ x ─ M" in drawn
    assert "circuit 5" not in drawn


def test_long_constants_are_shortened() -> None:
    assert "rz(1.2346)" in program("rz(1.23456789012)").draw()
    assert "1.235" in program("rz(1.23456789012)").draw("latex")
    assert "rz(pi/3)" in program(f"rz({math.pi / 3!r})").draw()


def test_no_circuits_and_no_gates() -> None:
    assert program("").draw() == "circuit 0  |0>─ M\n"
    for form in ("text", "svg", "latex"):
        assert Program(()).draw(form)


def test_words_in_svg_are_escaped() -> None:
    lima = load_device("ibm_lima").model_copy(update={"name": "<b>&"})
    drawn = compile(program("h"), lima, 2).draw("svg")
    assert "after, for <b>&, level 2" in shown(drawn)


def test_forms_and_suffixes_that_there_are_not() -> None:
    with pytest.raises(FigureError, match=r"^There is no form 'png'\.\n  Forms: text, svg, latex"):
        TWO.draw("png")  # type: ignore[arg-type]
    with pytest.raises(FigureError, match=r"^a\.pdf must end with \.txt, \.svg or \.tex\.$"):
        form_of(Path("a.pdf"))


@pytest.mark.parametrize(
    ("name", "latex"),
    [
        ("θθ_0", "\\textrm{$\\theta$$\\theta$}_{0}"),
        ("αβ", "\\textrm{$\\alpha$$\\beta$}"),
        ("é1", "\\textrm{é}_{1}"),
        ("θ_0", "\\theta_{0}"),
    ],
)
def test_letters_in_names_are_mathematics_within_text(name: str, latex: str) -> None:
    r"""In \textrm, which is text, a dollar begins mathematics again; in \mathrm it ends."""
    named = Program((Circuit.parse(f"rz({name})"),), (name,))
    assert f"\\gate{{R_{{z}}({latex})}}" in named.draw("latex")
