"""Circuits for a terminal: a line for each wire."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from qcompile.ir import Gate
from qcompile.report.drawing.columns import crossed, folds
from qcompile.report.drawing.diagram import Diagram

ROOM = 100
"""Letters of a line: drawings of circuits of several qubits are folded, others are not."""
_START, _BROKEN = "|0>", "..."
_DOT, _PLUS, _LINE, _CROSSING = "●", "⊕", "│", "┼"


def text(diagrams: Sequence[Diagram], room: int = ROOM) -> str:
    """Every diagram as lines: circuit 0  |0>─ h ─ ry(x0) ─ M."""
    parts = ["\n".join(_lines(diagram, room)) for diagram in diagrams]
    return "\n\n".join(parts) + "\n"


def _lines(diagram: Diagram, room: int) -> list[str]:
    lines = [diagram.title] if diagram.title else []
    names = _names(diagram)
    cells = [_cells(column, len(diagram.wires)) for column in diagram.columns]
    widths = [max(len(word) for word in column if word) for column in cells]
    left = max(map(len, names), default=0) + len(f"  {_START}─ M {_BROKEN}")
    parts = [slice(0, len(cells))]
    if diagram.is_wide:
        parts = folds([width + 3 for width in widths], max(room - left, 1))
    for part in parts:
        if part.start:
            lines.append("")
        shown = list(zip(cells[part], widths[part], strict=True))
        starts = [f"{name}  {_BROKEN if part.start else _START}─" for name in names]
        rows = [
            [_boxed(column[wire], width + 2) for column, width in shown]
            for wire in range(len(diagram.wires))
        ]
        ends = [
            f" {_BROKEN}" if part.stop < len(cells) else " M" if wire.is_measured else ""
            for wire in diagram.wires
        ]
        drawn = [
            start + "─".join([*row, end] if end else row)
            for start, row, end in zip(starts, rows, ends, strict=True)
        ]
        lines += _joined(diagram, drawn, widths, part, len(starts[0]) if starts else 0)
    apart = [""] * (diagram.is_wide and bool(diagram.notes))
    return [*lines, *apart, *diagram.notes]


def _names(diagram: Diagram) -> list[str]:
    """The names of the wires, all of one length; that of a circuit stands at its first wire."""
    names = []
    for group in diagram.groups:
        for wire in (diagram.wires[index] for index in group):
            before = f"{wire.circuit}, " if wire.circuit else ""
            if wire is not diagram.wires[group.start]:
                before = " " * len(before)
            names.append(before + wire.label)
    longest = max(map(len, names), default=0)
    return [name.ljust(longest) for name in names]


def _cells(column: Sequence[Gate], wires: int) -> list[str]:
    """What stands on each wire, "" for nothing."""
    cells = [""] * wires
    for gate in column:
        if not gate.is_coupling:
            cells[gate.qubits[0]] = gate_words(gate)
            continue
        for wire in crossed(gate):
            cells[wire] = _CROSSING
        for wire, word in zip(gate.qubits, _ENDS[gate.name], strict=True):
            cells[wire] = word
    return cells


_ENDS = {"cx": (_DOT, _PLUS), "cz": (_DOT, _DOT), "ecr": ("ecr:0", "ecr:1")}
"""What stands on the control and on the target of a coupling."""


def _boxed(word: str, width: int) -> str:
    """A word on its wire; those of couplings in the middle, where the line between them is."""
    if word in (_DOT, _PLUS, _CROSSING):
        return word.center(width, "─")
    boxed = f" {word} " if word else ""
    return boxed.center(width, "─") if word in _ENDS["ecr"] else boxed.ljust(width, "─")


def _joined(
    diagram: Diagram, drawn: Sequence[str], widths: Sequence[int], part: slice, left: int
) -> Iterator[str]:
    """The lines of the wires, and between those of one circuit its couplings."""
    if not diagram.is_wide:
        yield from drawn
        return
    middles, at = [], left
    for width in widths[part]:
        middles.append(at + (width + 1) // 2)
        at += width + 3
    for number, group in enumerate(diagram.groups):
        if number:
            yield ""
        for wire in group:
            yield drawn[wire]
            if wire == group[-1]:
                continue
            below = [" "] * at
            for middle, column in zip(middles, diagram.columns[part], strict=True):
                if any(gate.is_coupling and wire in crossed(gate)[:-1] for gate in column):
                    below[middle] = _LINE
            yield "".join(below).rstrip()


def gate_words(gate: Gate) -> str:
    """A gate as OpenQASM has it, constants that are not fractions of pi to four decimals."""
    words = gate.to_text()
    if gate.angle is not None and gate.angle.is_constant:
        short = "pi" in words or len(words) < 12
        return words if short else f"{gate.name}({gate.angle.constant:.4f})"
    return words
