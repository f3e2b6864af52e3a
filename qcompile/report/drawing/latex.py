"""Circuits for a paper: environments of LaTeX's quantikz."""

from __future__ import annotations

import re
from collections.abc import Sequence

from qcompile.ir import Gate
from qcompile.report.drawing.diagram import Diagram
from qcompile.report.drawing.labels import GREEK, Run, label
from qcompile.report.table import latex_text

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
    rows = []
    for wire in diagram.wires:
        name = latex_text(wire.label)
        cells = [f"\\lstick{{{name}: $\\ket{{0}}$}}", *map(_gate, wire.gates)]
        cells += [r"\qw"] * (diagram.columns - len(wire.gates))
        rows.append(" & ".join([*cells, r"\meter{}"]))
    return [
        *([_comment(diagram.title)] if diagram.title else []),
        r"\begin{quantikz}",
        *(f"{row} \\\\" for row in rows[:-1]),
        *rows[-1:],
        r"\end{quantikz}",
        *map(_comment, diagram.notes),
    ]


def _comment(words: str) -> str:
    return f"% {' '.join(words.split())}"


def _gate(gate: Gate) -> str:
    return f"\\gate{{{''.join(map(_math, label(gate)))}}}"


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
