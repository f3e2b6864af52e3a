"""Circuits drawn as text, SVG and LaTeX: before and after compilation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypeAlias

from qcompile.errors import FigureError
from qcompile.ir import Program
from qcompile.passes import Executable
from qcompile.report.drawing.diagram import Diagram, compiled, source
from qcompile.report.drawing.latex import latex
from qcompile.report.drawing.svg import svg
from qcompile.report.drawing.text import text

Form: TypeAlias = Literal["text", "svg", "latex"]

FORMS = {"text": text, "svg": svg, "latex": latex}
SUFFIXES: dict[str, Form] = {".txt": "text", ".svg": "svg", ".tex": "latex"}


def draw_program(program: Program, form: Form = "text", circuit: int | None = None) -> str:
    """A program's circuits, one of each shape, or one circuit alone.

    "text" is for a terminal, "svg" an <svg> element in the colour of the text around it, and
    "latex" a quantikz environment.

    Raises:
        FigureError: there is no such form or circuit.
    """
    return _drawn([source(program, circuit)], form)


def draw_executable(
    executable: Executable,
    form: Form = "text",
    circuit: int | None = None,
    *,
    numbers: Sequence[int] | None = None,
) -> str:
    """The circuits before and after compilation, as `draw_program` draws them.

    `numbers` are what the circuits are called, instead of 0, 1, ...

    Raises:
        FigureError: there is no such form or circuit.
    """
    return _drawn(compiled(executable, circuit, numbers), form)


def form_of(path: Path) -> Form:
    """The form that a file's suffix stands for.

    Raises:
        FigureError: it stands for none.
    """
    if path.suffix not in SUFFIXES:
        raise FigureError(f"{path} must end with .txt, .svg or .tex.")
    return SUFFIXES[path.suffix]


def _drawn(diagrams: Sequence[Diagram], form: str) -> str:
    if not isinstance(form, str) or form not in FORMS:
        raise FigureError(f"There is no form {form!r}.", f"Forms: {', '.join(FORMS)}.")
    return FORMS[form](diagrams)
