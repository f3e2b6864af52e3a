"""Circuits for a terminal: a line for each wire."""

from __future__ import annotations

from collections.abc import Sequence

from qcompile.ir import Gate
from qcompile.report.drawing.diagram import Diagram


def text(diagrams: Sequence[Diagram]) -> str:
    """Every diagram as lines: circuit 0  |0>─ h ─ ry(x0) ─ M."""
    parts = ["\n".join(_lines(diagram)) for diagram in diagrams]
    return "\n\n".join(parts) + "\n"


def _lines(diagram: Diagram) -> list[str]:
    width = max((len(wire.label) for wire in diagram.wires), default=0)
    cells = [[gate_words(gate) for gate in wire.gates] for wire in diagram.wires]
    widths = [max(len(row[k]) for row in cells if k < len(row)) for k in range(diagram.columns)]
    lines = [diagram.title] if diagram.title else []
    for wire, row in zip(diagram.wires, cells, strict=True):
        boxes = [f" {word} ".ljust(wide + 2, "─") for word, wide in zip(row, widths, strict=False)]
        boxes += ["─" * (wide + 2) for wide in widths[len(row) :]]
        lines.append(f"{wire.label.ljust(width)}  |0>─{'─'.join([*boxes, ' M'])}")
    return [*lines, *diagram.notes]


def gate_words(gate: Gate) -> str:
    """A gate as OpenQASM has it, constants that are not fractions of pi to four decimals."""
    if gate.angle is not None and gate.angle.is_constant:
        words = str(gate)
        short = "pi" in words or len(words) < 12
        return words if short else f"{gate.name}({gate.angle.constant:.4f})"
    return str(gate)
