"""Circuits of several qubits, drawn: the expected drawings are written by hand."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from qcompile.device import load_device
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable, compile
from qcompile.report.drawing import draw_executable
from qcompile.report.drawing.columns import columns_of, folds

SVG = "{http://www.w3.org/2000/svg}"


def program(text: str, width: int, *narrow: str, **others: object) -> Program:
    circuits = [Circuit.parse(text, width), *map(Circuit.parse, narrow)]
    return replace(Program.of(circuits, 2, 1), **others)


CHAIN = program("ry(x0)@0 h@1 cx@0,2 cz@0,1 rz(theta0)@2", 3, observables=((0, 1), (2,)))


def routed() -> Executable:
    """A cx of two qubits that are not coupled, by hand: through a third one, which is left."""
    native = Circuit.parse("sx@0 cx@0,2 cx@2,1 cx@0,2", 3)
    source = program("h@0 cx@0,1", 2)
    return Executable(
        source,
        Program((native,), source.inputs, source.parameters),
        load_device("fake_lima"),
        2,
        np.array([0, 2, 1]),
        np.array([0]),
    )


def test_a_gate_is_as_far_left_as_its_qubits_and_the_wires_between_allow() -> None:
    """By hand: s fits below cx@0,1, cz@0,2 crosses the wire of x, and t stands before it."""
    circuit = Circuit.parse("cx@0,1 s@2 x@1 cz@0,2 t@1 h@0", 3)
    names = [[str(gate) for gate in column] for column in columns_of(circuit)]
    assert names == [["cx@0,1", "s@2"], ["x@1"], ["cz@0,2"], ["t@1", "h"]]
    early = Circuit.parse("h@0 h@0 cz@0,2 x@1 y@1 z@1", 3)
    names = [[str(gate) for gate in column] for column in columns_of(early)]
    assert names == [["h", "x@1"], ["h", "y@1"], ["cz@0,2"], ["z@1"]]


def test_text_joins_the_qubits_of_a_coupling() -> None:
    assert CHAIN.draw() == (
        "circuit 0, bit 0  |0>─ ry(x0) ──●───────●─────── M\n"
        "                                │       │\n"
        "           bit 1  |0>─ h ───────┼───────●─────── M\n"
        "                                │\n"
        "           bit 2  |0>───────────⊕── rz(theta0) ─ M\n"
        "\n"
        "observables: <Z0 Z1>, <Z2>\n"
    )


def test_ends_of_ecr_are_told_apart() -> None:
    drawn = program("ecr@1,0", 2).draw().splitlines()
    assert drawn == [
        "circuit 0, bit 0  |0>─ ecr:1 ─ M",
        "                         │",
        "           bit 1  |0>─ ecr:0 ─ M",
    ]


def test_a_circuit_of_one_qubit_stands_apart() -> None:
    drawn = program("cz@0,1", 2, "h").draw().splitlines()
    assert drawn[3:5] == ["", "circuit 1, bit 2  |0>─ h ─ M"]


def test_qubits_of_routing_are_marked_and_not_measured() -> None:
    drawn = routed().draw()
    lines = drawn.split("\n\n")[1].splitlines()
    assert lines[0] == "after, for fake_lima, level 2"
    assert lines[1].startswith("circuit 0, bit 0, qubit 0        |0>─ sx ──●")
    assert lines[5].startswith("           qubit 1, for routing  |0>───────⊕")
    assert [line.endswith(" M") for line in lines[1::2]] == [True, True, False]
    svg = ElementTree.fromstring(routed().draw("svg"))
    assert len([*svg.iter(f"{SVG}rect")]) == (1 + 2) + (1 + 2), "h, sx and four dials"
    latex = routed().draw("latex").splitlines()
    assert [line.endswith("\\qw") for line in latex if "routing" in line] == [True]


def test_svg_has_dots_circles_and_boxes() -> None:
    root = ElementTree.fromstring(CHAIN.draw("svg"))
    dots = [c for c in root.iter(f"{SVG}circle") if c.get("fill") == "currentColor"]
    assert len(dots) == 1 + 2, "of cx, and of cz"
    assert len([*root.iter(f"{SVG}circle")]) == len(dots) + 1
    assert len([*root.iter(f"{SVG}rect")]) == 3 + 3
    boxes = ElementTree.fromstring(program("ecr@0,1", 2).draw("svg"))
    words = ["".join(t.itertext()).replace("\u200b", "") for t in boxes.iter(f"{SVG}text")]
    assert [word for word in words if word.startswith("ECR")] == ["ECR0", "ECR1"]


def test_latex_has_the_couplings_of_quantikz() -> None:
    lines = program("cx@2,0 cz@0,1 ecr@0,1 ecr@2,0", 3).draw("latex").splitlines()[2:5]
    assert [line.rstrip(" \\").split(" & ")[1:-1] for line in lines] == [
        [r"\targ{}", r"\ctrl{1}", r"\gate{ECR_{0}}\wire[d][1]{q}", r"\gate{ECR_{1}}"],
        [r"\qw", r"\control{}", r"\gate{ECR_{1}}", r"\qw"],
        [r"\ctrl{-2}", r"\qw", r"\qw", r"\gate{ECR_{0}}\wire[u][2]{q}"],
    ]


@pytest.mark.parametrize(
    ("widths", "room", "ends"),
    [([3, 3, 3], 9, [3]), ([3, 3, 3], 8, [2, 3]), ([9, 1], 5, [1, 2]), ([], 5, [0])],
)
def test_lines_hold_what_fits_and_one_column_at_least(
    widths: list[float], room: float, ends: list[int]
) -> None:
    assert [line.stop for line in folds(widths, room)] == ends


def deep() -> Program:
    layer = "ry(x0)@0 ry(x1)@1 cx@0,1 rz(theta0)@1 cz@1,0 "
    return program(layer * 12, 2)


def test_long_drawings_are_folded() -> None:
    lines = deep().draw().splitlines()
    assert max(map(len, lines)) <= 100
    wires = [line for line in lines if "bit 0" in line]
    assert len(wires) > 2
    assert "  |0>─" in wires[0]
    assert all("  ...─" in line for line in wires[1:])
    assert [line.endswith("─ ...") for line in wires] == [True] * (len(wires) - 1) + [False]
    assert sum(line.count("ry(x0)") for line in wires) == 12
    root = ElementTree.fromstring(deep().draw("svg"))
    assert float(root.get("width", 0)) < 960
    environments = deep().draw("latex").count("\\begin{quantikz}")
    assert environments > 1
    assert deep().draw("latex").count("\\meter{}") == 2


def test_circuits_of_one_shape_are_drawn_once() -> None:
    circuits = [
        Circuit.parse(text, 2) for text in ("ry(x0)@0 cx@0,1", "ry(x1)@0 cx@0,1", "ry(x1)@0 cx@1,0")
    ]
    drawn = Program.of(circuits, 2).draw()
    assert "circuit 0 stands for 2 circuits of its shape: 0, 1" in drawn
    assert "circuit 2, bit 4" in drawn
    assert "circuit 1" not in drawn


def test_angles_beyond_a_dozen_are_counted() -> None:
    layer = "ry(x0)@0 rz(x1)@0 ry(theta0)@0 ry(x1)@1 rz(x0)@1 ry(theta0)@1 cx@0,1 cx@1,0 "
    notes = draw_executable(compile(program(layer * 6, 2), load_device("ideal"))).splitlines()
    definitions = [note for note in notes if "{" in note]
    assert len(definitions) == 12
    assert notes[-1].startswith("and ")
    assert notes[-1].endswith(" more angles that are computed when it is bound")


def test_products_of_narrow_circuits_are_named() -> None:
    swapped = replace(
        Program.of(map(Circuit.parse, ("ry(x0)", "ry(x1)")), 2), observables=((1,), (0,))
    )
    assert "circuit 0  |0>─ ry(x0) ─ M" in swapped.draw()
    assert "observables: <Z1>, <Z0>" in swapped.draw()
