"""Means with their intervals as figures: in columns, or over the number of shots."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from qcompile.report.columns import Columns
from qcompile.report.figure import Figure, literal, write_title
from qcompile.report.legend import legend_below, letter_width_in
from qcompile.report.lines import Lines
from qcompile.report.means import Panel, draw_across, write_height
from qcompile.report.style import AnyStyle, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure
    from matplotlib.text import Text

_MOST_IN_COLUMNS = 2
"""More numbers of shots than these have an axis."""
_LINE_EM = 1.3
"""The height of a line, in font sizes."""
_SIDES_IN = 0.35
"""What is left beside the name of a panel."""


def draw_intervals(title: str, panels: Sequence[Panel], style: AnyStyle = None) -> Figure:
    """The panels side by side, in one column or across two, and in several rows where they must be.

    A panel has a column for each device; more than two numbers of shots have an axis instead.

    Raises:
        FigureError: the style cannot be read.
    """
    look = Style.of(style)
    form = (Lines if _is_sweep(panels) else Columns)(panels, look)
    with look.applied():
        widths = [form.width_in(panel) for panel in form.panels]
        rows = _rows(widths, look.page_in)
        wide = len(rows) > 1 or sum(widths) > look.column_in
        drawing = look.drawing(len(rows) * look.height_in, wide=wide)
        write_title(drawing, title)
        across: dict[str, Any] = {}
        scales: dict[str, Axes] = {}
        titles: list[Text] = []
        parts = drawing.subfigures(len(rows), 1, squeeze=False)[:, 0]
        longest_in = max(sum(widths[index] for index in row) for row in rows)
        for part, row in zip(parts, rows, strict=True):
            own = [widths[index] for index in row]
            panes = _panes(part, own, longest_in - sum(own))
            for axes, index in zip(panes, row, strict=True):
                panel = form.panels[index]
                width_in = drawing.get_figwidth() * widths[index] / longest_in
                for label, sample in draw_across(axes, panel).items():
                    if not isinstance(across.get(label), tuple):  # a line with its interval
                        across[label] = sample
                form.draw(axes, panel, width_in)
                titles.append(_write_name(axes, panel.title, width_in))
                axes.grid(axis="y")
                axes.sharey(scales.setdefault(panel.scale, axes))
            _write_scales(panes, [form.panels[index] for index in row])
        for axes in scales.values():
            axes.autoscale_view(scalex=False)  # to the intervals of all panels that share it
        names = [label for axes in drawing.axes for label in axes.get_xticklabels()]
        more_in = len(rows) * (_more_in(titles, drawing.dpi) + _more_in(names, drawing.dpi))
        drawing.set_figheight(drawing.get_figheight() + more_in)
        legend_below(drawing, form.samples() | across)
    return Figure(drawing, look)


def _is_sweep(panels: Sequence[Panel]) -> bool:
    """Whether a panel has more numbers of shots than columns show."""
    counts = (len({interval.shots for interval in panel.intervals}) for panel in panels)
    return max(counts, default=0) > _MOST_IN_COLUMNS


def _rows(widths: Sequence[float], page_in: float) -> list[list[int]]:
    """The panels in as few rows as a page has room for, and these as even as they can be."""
    rows = _filled(widths, page_in)
    while True:
        widest_in = max(sum(widths[index] for index in row) for row in rows)
        even = _filled(widths, widest_in - 1e-6)
        if even == rows or len(even) > len(rows):
            return rows
        rows = even


def _filled(widths: Sequence[float], most_in: float) -> list[list[int]]:
    """The panels in rows, each as full as the first ones let it be."""
    rows: list[list[int]] = [[]]
    for index, width_in in enumerate(widths):
        if rows[-1] and sum(widths[other] for other in rows[-1]) + width_in > most_in:
            rows.append([])
        rows[-1].append(index)
    return rows


def _panes(part: SubFigure, widths: Sequence[float], rest: float) -> list[Axes]:
    """Axes of these widths; a `rest` that one more would fit into stays empty."""
    empty = [rest] * (rest >= min(widths))
    panes = part.subplots(
        1, len(widths) + len(empty), squeeze=False, width_ratios=[*widths, *empty]
    )
    for axes in panes[0, len(widths) :]:
        axes.set_axis_off()
    return [*panes[0, : len(widths)]]


def _write_name(axes: Axes, name: str, width_in: float) -> Text:
    """Write what a panel shows above it, in lines that do not reach the next one."""
    letters = max(int((width_in - _SIDES_IN) / letter_width_in("axes.titlesize")), 1)
    return axes.set_title(literal("\n".join(wrap(name, letters))))


def _more_in(words: Sequence[Text], dpi: float) -> float:
    """How much higher than a line the highest of some words are, in inches."""
    return max(
        0.0,
        *(
            text.get_window_extent().height / dpi - _LINE_EM * float(text.get_fontsize()) / 72
            for text in words
        ),
    )


def _write_scales(panes: Sequence[Axes], row: Sequence[Panel]) -> None:
    """The axis of rewards, and where it is solved, once for neighbours of one scale."""
    panes[0].set_ylabel("mean reward,\n95 % interval")
    for index, (axes, panel) in enumerate(zip(panes, row, strict=True)):
        if index and row[index - 1].scale == panel.scale:
            axes.tick_params(labelleft=False)
        follows = index + 1 < len(row) and row[index + 1].scale == panel.scale
        if panel.solved is not None and not follows:
            write_height(axes, panel.solved)
