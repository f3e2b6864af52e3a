"""Circuits for pages and slides: SVG in the colour of the text around it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from qcompile.ir import Gate
from qcompile.notebook import html_text
from qcompile.report.drawing.columns import folds
from qcompile.report.drawing.diagram import Diagram, Wire
from qcompile.report.drawing.labels import SIZE, SMALL, Run, label, width_px

ROOM = 940.0
"""px of a line: drawings of circuits of several qubits are folded, others are not."""
_FONT = "DejaVu Sans, Helvetica, Arial, sans-serif"
_ROW, _BOX, _GAP, _PAD, _METER = 44.0, 28.0, 14.0, 7.0, 30.0
_LINE, _EDGE = 20.0, 8.0
_DOT, _PLUS, _NARROW = 4.5, 9.0, 18.0
"""Radius of a control and of a target, and the width of a column of these alone."""
_BRACKET = 6.0


def svg(diagrams: Sequence[Diagram], room: float = ROOM) -> str:
    """One <svg> element, the diagrams below each other; it has no colours of its own."""
    parts: list[str] = []
    top, right = _EDGE, 0.0
    for diagram in diagrams:
        drawn, top, end = _diagram(diagram, top, room)
        parts += drawn
        right = max(right, end)
        top += _LINE / 2
    names = "; ".join(filter(None, (diagram.title for diagram in diagrams)))
    title = html_text(f"Circuits, {names}" if names else "Circuits")
    width, height = right + _EDGE, top - _LINE / 2 + _EDGE
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="{title}" '
            f'fill="none" stroke="currentColor" font-family="{_FONT}" font-size="{SIZE:g}">',
            f"<title>{title}</title>",
            *parts,
            "</svg>",
            "",
        ]
    )


def _diagram(diagram: Diagram, top: float, room: float) -> tuple[list[str], float, float]:
    """Its elements, where it ends below, and where on the right."""
    parts: list[str] = []
    right = 0.0

    def write(words: str) -> None:
        nonlocal top, right
        parts.append(_text(_EDGE, top + _LINE / 2, [Run(words)], anchor="start"))
        top, right = top + _LINE, max(right, _EDGE + width_px([Run(words)]))

    if diagram.title:
        write(diagram.title)
    names = max((width_px([Run(f"{w.circuit}  ")]) for w in diagram.wires if w.circuit), default=0)
    names += 2 * _BRACKET if names else 0.0
    starts = [width_px(_start(wire, "|0⟩")) for wire in diagram.wires]
    left = _EDGE + names + max(starts, default=0.0) + _GAP / 2
    widths = [max(map(_width, column)) for column in diagram.columns]
    lines = [slice(0, len(widths))]
    if diagram.is_wide:
        lines = folds([width + _GAP for width in widths], room - left - _METER - 2 * _GAP)
    for number, line in enumerate(lines):
        rows = _rows(diagram, top)
        drawn, end = _part(diagram, line, widths[line], rows, left)
        parts += drawn
        right = max(right, end)
        top = rows[-1] + _ROW / 2 if rows else top
        top += _LINE / 2 if number < len(lines) - 1 else 0.0
    for note in diagram.notes:
        write(note)
    return parts, top, right


def _rows(diagram: Diagram, top: float) -> list[float]:
    """The height of each wire; circuits of several qubits are apart from others."""
    rows: list[float] = []
    for number, group in enumerate(diagram.groups):
        if number and diagram.is_wide:
            top += _LINE / 2
        rows += [top + (index + 0.5) * _ROW for index in range(len(group))]
        top += _ROW * len(group)
    return rows


def _start(wire: Wire, ket: str) -> list[Run]:
    return [Run(f"{wire.label}  {ket}")]


def _names(diagram: Diagram, rows: Sequence[float], left: float) -> Iterable[str]:
    """The name of each circuit of several qubits, and the bracket around its wires."""
    for group in diagram.groups:
        name = diagram.wires[group.start].circuit
        if not name:
            continue
        first, last = rows[group.start], rows[group.stop - 1]
        longest = max(width_px(_start(diagram.wires[index], "|0⟩")) for index in group)
        x = left - _GAP / 2 - longest - _BRACKET
        if len(group) > 1:
            top, bottom = first - _ROW / 3, last + _ROW / 3
            yield f'<path d="M{x:.1f} {top:.1f}h{-_BRACKET:g}V{bottom:.1f}h{_BRACKET:g}"/>'
        yield _text(x - 2 * _BRACKET, (first + last) / 2, [Run(name)], anchor="end")


def _part(
    diagram: Diagram, line: slice, widths: Sequence[float], rows: Sequence[float], left: float
) -> tuple[list[str], float]:
    """Some columns of a diagram, on its wires, which begin at `left`; and where they end."""
    middles, x = [], left + _GAP
    for width in widths:
        middles.append(x + width / 2)
        x += width + _GAP
    ket = "…" if line.start else "|0⟩"
    is_last = line.stop == len(diagram.columns)
    parts = [*_names(diagram, rows, left)]
    boxes: list[list[tuple[float, list[Run]]]] = [[] for _ in rows]
    for column, middle in zip(diagram.columns[line], middles, strict=True):
        for gate in column:
            parts += _link(gate, middle, rows) if gate.is_coupling else []
            for qubit, runs in zip(gate.qubits, _boxes(gate), strict=False):
                boxes[qubit].append((middle, runs))
    for wire, y, own in zip(diagram.wires, rows, boxes, strict=True):
        drawn_to = left
        parts.append(_text(left - _GAP / 2, y, _start(wire, ket), anchor="end"))
        for middle, runs in own:
            width = _box_width(runs)
            at = middle - width / 2
            parts += [_line(drawn_to, at, y), _box(at, y, width), _text(middle, y, runs)]
            drawn_to = at + width
        if is_last and wire.is_measured:
            parts += [_line(drawn_to, x, y), *_meter(x, y)]
        else:
            parts.append(_line(drawn_to, x + _METER * is_last, y))
            parts += [] if is_last else [_text(x + _METER / 2, y, [Run("…")])]
    return parts, x + _METER


def _boxes(gate: Gate) -> list[list[Run]]:
    """The labels of a gate's boxes: none for cx and cz."""
    if not gate.is_coupling:
        return [label(gate)]
    if gate.name != "ecr":
        return []
    return [[*label(gate)[:-1], Run(label(gate)[-1].text, low=end)] for end in "01"]


def _link(gate: Gate, x: float, rows: Sequence[float]) -> list[str]:
    """The line between the qubits of a coupling, and what stands on them that is no box."""
    control, target = (rows[qubit] for qubit in gate.qubits)
    if gate.name == "ecr":
        low, high = sorted((control, target))
        return [_upright(x, low + _BOX / 2, high - _BOX / 2)]
    if gate.name == "cz":
        return [_upright(x, control, target), _dot(x, control), _dot(x, target)]
    end = target + math.copysign(_PLUS, target - control)
    circle = f'<circle cx="{x:.1f}" cy="{target:.1f}" r="{_PLUS:g}"/>'
    return [_upright(x, control, end), _dot(x, control), circle]


def _upright(x: float, start: float, end: float) -> str:
    return f'<path d="M{x:.1f} {start:.1f}V{end:.1f}"/>'


def _dot(x: float, y: float) -> str:
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{_DOT:g}" fill="currentColor"/>'


def _width(gate: Gate) -> float:
    return max(map(_box_width, _boxes(gate)), default=_NARROW)


def _box_width(runs: Sequence[Run]) -> float:
    return max(width_px(runs) + 2 * _PAD, _BOX)


def _line(start: float, end: float, y: float) -> str:
    return f'<path d="M{start:.1f} {y:.1f}H{end:.1f}"/>'


def _box(x: float, y: float, width: float) -> str:
    top = y - _BOX / 2
    return f'<rect x="{x:.1f}" y="{top:.1f}" width="{width:.1f}" height="{_BOX:g}" rx="3"/>'


def _meter(x: float, y: float) -> list[str]:
    """A dial with its hand."""
    middle, low = x + _METER / 2, y + 6
    return [
        _box(x, y, _METER),
        f'<path d="M{middle - 9:.1f} {low:.1f}a9 9 0 0 1 18 0M{middle:.1f} {low:.1f}l6 -13"/>',
    ]


def _text(x: float, y: float, runs: Iterable[Run], anchor: str = "middle") -> str:
    pieces = []
    for run in runs:
        pieces.append(html_text(run.text))
        for words, shift in ((run.low, 3.5), (run.high, -4.5)):
            if words:
                small = f'<tspan dy="{shift:g}" font-size="{SMALL:g}">{html_text(words)}</tspan>'
                pieces.append(f'{small}<tspan dy="{-shift:g}">&#8203;</tspan>')
    return (
        f'<text x="{x:.1f}" y="{y + 4.5:.1f}" text-anchor="{anchor}" fill="currentColor" '
        f'stroke="none" xml:space="preserve">{"".join(pieces)}</text>'
    )
