"""Circuits for pages and slides: SVG in the colour of the text around it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from qcompile.notebook import html_text
from qcompile.report.drawing.diagram import Diagram
from qcompile.report.drawing.labels import Run, label

_FONT = "DejaVu Sans, Helvetica, Arial, sans-serif"
_SIZE, _SMALL = 13.0, 9.0
"""Font sizes in px: of labels and of what is lowered or raised."""
_LETTER_EM = 0.62
_ROW, _BOX, _GAP, _PAD, _METER = 44.0, 28.0, 14.0, 7.0, 30.0
_LINE, _EDGE = 20.0, 8.0


def svg(diagrams: Sequence[Diagram]) -> str:
    """One <svg> element, the diagrams below each other; it has no colours of its own."""
    parts: list[str] = []
    top, right = _EDGE, 0.0
    for diagram in diagrams:
        drawn, top, end = _diagram(diagram, top)
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
            f'fill="none" stroke="currentColor" font-family="{_FONT}" font-size="{_SIZE:g}">',
            f"<title>{title}</title>",
            *parts,
            "</svg>",
            "",
        ]
    )


def _diagram(diagram: Diagram, top: float) -> tuple[list[str], float, float]:
    """Its elements, where it ends below, and where on the right."""
    parts: list[str] = []
    right = 0.0

    def write(words: str) -> None:
        nonlocal top, right
        parts.append(_text(_EDGE, top + _LINE / 2, [Run(words)], anchor="start"))
        top, right = top + _LINE, max(right, _EDGE + _width([Run(words)]))

    if diagram.title:
        write(diagram.title)
    starts = [[Run(f"{wire.label}  |0⟩")] for wire in diagram.wires]
    left = _EDGE + max(map(_width, starts), default=0.0) + _GAP / 2
    labels = [[label(gate) for gate in wire.gates] for wire in diagram.wires]
    widths = [
        max(_box_width(row[k]) for row in labels if k < len(row)) for k in range(diagram.columns)
    ]
    end = left + sum(widths) + _GAP * (len(widths) + 1)
    for start, row in zip(starts, labels, strict=True):
        y, x, drawn_to = top + _ROW / 2, left + _GAP, left
        parts.append(_text(left - _GAP / 2, y, start, anchor="end"))
        for runs, room in zip(row, widths, strict=False):
            width = _box_width(runs)
            at = x + (room - width) / 2
            parts += [_line(drawn_to, at, y), _box(at, y, width), _text(at + width / 2, y, runs)]
            drawn_to, x = at + width, x + room + _GAP
        parts += [_line(drawn_to, end, y), *_meter(end, y)]
        top += _ROW
    right = max(right, end + _METER)
    for note in diagram.notes:
        write(note)
    return parts, top, right


def _width(runs: Iterable[Run]) -> float:
    """What a label needs, in px, as letters are wide on average."""
    return _LETTER_EM * sum(
        len(run.text) * _SIZE + max(len(run.low), len(run.high)) * _SMALL for run in runs
    )


def _box_width(runs: Sequence[Run]) -> float:
    return max(_width(runs) + 2 * _PAD, _BOX)


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
                small = f'<tspan dy="{shift:g}" font-size="{_SMALL:g}">{html_text(words)}</tspan>'
                pieces.append(f'{small}<tspan dy="{-shift:g}">&#8203;</tspan>')
    return (
        f'<text x="{x:.1f}" y="{y + 4.5:.1f}" text-anchor="{anchor}" fill="currentColor" '
        f'stroke="none" xml:space="preserve">{"".join(pieces)}</text>'
    )
