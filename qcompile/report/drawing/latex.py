"""Circuits for a paper: environments of LaTeX's quantikz."""

from __future__ import annotations

import re
from collections.abc import Sequence

from qcompile.ir import Gate
from qcompile.report.drawing.columns import folds
from qcompile.report.drawing.diagram import Diagram, Wire
from qcompile.report.drawing.labels import GREEK, Run, label, width_px
from qcompile.report.table import latex_text

_ROOM, _CELL = 700.0, 28.0
"""What fits on a page, and what a gate needs beside its label, in px of `width_px`.

Drawings of circuits of several qubits are folded, others are not.
"""
_HEAD = "% needs \\usepackage{tikz} and \\usetikzlibrary{quantikz2}"
_MATH = {
    **{letter: f"\\{name} " for name, letter in GREEK.items()},
    "π": r"\pi ",
    "†": r"\dagger",
    "−": "-",
    "√X": r"\sqrt{X}",
}
_POWER = re.compile(r"e([+-]\d+)")


def latex(diagrams: Sequence[Diagram]) -> str:
    r"""A quantikz environment for each diagram, to \input; titles and notes are comments."""
    return "\n".join([_HEAD, *("\n".join(_lines(diagram)) for diagram in diagrams), ""])


def _lines(diagram: Diagram) -> list[str]:
    parts = [slice(0, len(diagram.columns))]
    if diagram.is_wide:
        widths = [max(_width(gate) for gate in column) for column in diagram.columns]
        longest = max((width_px([Run(_name(wire))]) for wire in diagram.wires), default=0)
        parts = folds(widths, _ROOM - longest)
    return [
        *([_comment(diagram.title)] if diagram.title else []),
        *(line for part in parts for line in _environment(diagram, part)),
        *map(_comment, diagram.notes),
    ]


def _environment(diagram: Diagram, part: slice) -> list[str]:
    """Some columns of a diagram, between its names and the measurements, or dots."""
    columns = [_cells(column) for column in diagram.columns[part]]
    is_last = part.stop == len(diagram.columns)
    rows = []
    for number, wire in enumerate(diagram.wires):
        ket = r"$\cdots$" if part.start else r"$\ket{0}$"
        cells = [f"\\lstick{{{latex_text(_name(wire))}: {ket}}}"]
        cells += [column.get(number, r"\qw") for column in columns]
        end = r"\meter{}" if wire.is_measured else r"\qw"
        rows.append(" & ".join([*cells, end if is_last else r"\ \cdots"]))
    return [
        r"\begin{quantikz}",
        *(f"{row} \\\\" for row in rows[:-1]),
        *rows[-1:],
        r"\end{quantikz}",
    ]


def _name(wire: Wire) -> str:
    return f"{wire.circuit}, {wire.label}" if wire.circuit else wire.label


def _cells(column: Sequence[Gate]) -> dict[int, str]:
    """What stands on each wire of a column that has something."""
    cells: dict[int, str] = {}
    for gate in column:
        first = gate.qubits[0]
        if not gate.is_coupling:
            cells[first] = _gate(label(gate))
            continue
        second = gate.qubits[1]
        down = second - first
        if gate.name == "ecr":
            (run,) = label(gate)
            cells[first], cells[second] = (_gate([Run(run.text, low=end)]) for end in "01")
            cells[first] += f"\\wire[{'d' if down > 0 else 'u'}][{abs(down)}]{{q}}"
        else:
            cells[first] = f"\\ctrl{{{down}}}"
            cells[second] = r"\targ{}" if gate.name == "cx" else r"\control{}"
    return cells


def _width(gate: Gate) -> float:
    return _CELL + (0.0 if gate.name in ("cx", "cz") else width_px(label(gate)))


def _comment(words: str) -> str:
    return f"% {' '.join(words.split())}"


def _gate(runs: Sequence[Run]) -> str:
    return f"\\gate{{{''.join(map(_math, runs))}}}"


def _math(run: Run) -> str:
    """A run in math mode; names that are more than a letter of it stand upright, as text."""
    if run.is_symbol and not (run.text in _MATH or (run.text.isascii() and len(run.text) == 1)):
        words = f"\\textrm{{{latex_text(run.text)}}}"
    else:
        words = run.text
        for letter, command in _MATH.items():
            words = words.replace(letter, command)
        words = _POWER.sub(lambda found: rf"\cdot 10^{{{int(found[1])}}}", words)
        words = words.replace("_", r"\_").rstrip() if run.is_symbol else words
    low = f"_{{{run.low}}}" if run.low else ""
    high = f"^{{{_MATH.get(run.high, run.high)}}}" if run.high else ""
    return words + low + high
