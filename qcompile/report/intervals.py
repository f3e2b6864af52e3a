"""Means with their intervals, in columns, as figures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from qcompile.report.figure import Figure, literal
from qcompile.report.legend import labelled, legend_below
from qcompile.report.style import AnyStyle, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_MARKERS = "osD^vP"
_GREY = "0.45"
_SPREAD = 0.6
_LETTERS_PER_INCH = 15
"""Of a column's name; twelve at least are left together."""
_LEAST_LETTERS = 12
_INTERVAL_IN, _SIDES_IN = 0.13, 0.35
"""What an interval needs, and what a panel needs besides its columns."""
_LINES = {"ideal": "ideal, exact expectations", "band": "its 95 % interval", "solved": "solved"}


@dataclass(frozen=True)
class Interval:
    """A mean between `low` and `high`, in the column of that name.

    Intervals of one `group` share a colour, those of one `variant` a marker; `grey` ones are what
    the others are compared with.
    """

    column: str
    group: str
    variant: str
    mean: float
    low: float
    high: float
    grey: bool = False

    @property
    def label(self) -> str:
        return ", ".join(part for part in (self.group, self.variant) if part)


@dataclass(frozen=True)
class Panel:
    """Intervals on one axis; `ideal` (mean, low, high) and `solved` are drawn across.

    Panels of one `scale` share the axis of rewards.
    """

    title: str
    intervals: Sequence[Interval]
    ideal: tuple[float, float, float] | None = None
    solved: float | None = None
    scale: str = ""


def draw_intervals(title: str, panels: Sequence[Panel], style: AnyStyle = None) -> Figure:
    """The panels side by side, in one column or across two, and in several rows where they must be.

    Raises:
        FigureError: the style cannot be read.
    """
    look = Style.of(style)
    rows = _rows(panels, look.page_in)
    wide = len(rows) > 1 or sum(map(_width_in, panels)) > look.column_in
    labels = _labels(panels)
    groups = list(dict.fromkeys(i.group for panel in panels for i in panel.intervals if not i.grey))
    variants = list(dict.fromkeys(i.variant for panel in panels for i in panel.intervals))
    scales: dict[str, Axes] = {}
    with look.applied():
        drawing = look.drawing(len(rows) * look.height_in, wide=wide)
        drawing.suptitle(literal(title), x=0.01, ha="left")
        width_in = look.page_in if wide else look.column_in
        parts = drawing.subfigures(len(rows), 1, squeeze=False)[:, 0]
        for part, row in zip(parts, rows, strict=True):
            for axes, panel in zip(_panes(part, row), row, strict=True):
                _draw(axes, panel, labels, groups, variants, look)
                letters = int(_LETTERS_PER_INCH * width_in * _width_in(panel) / _row_in(row))
                _name_columns(axes, panel, letters // len(_columns(panel)))
                axes.sharey(scales.setdefault(panel.scale, axes))
            _write_scales(part.axes, row)
        for axes in scales.values():
            axes.autoscale_view(scalex=False)  # to the intervals of all panels that share it
        found = labelled(*drawing.axes)
        order = [*(label for label in labels if label in found), *_LINES.values()]
        legend_below(drawing, {label: found[label] for label in order if label in found})
    return Figure(drawing, look)


def _rows(panels: Sequence[Panel], page_in: float) -> list[list[Panel]]:
    """The panels in rows that a page has room for, each as full as the first ones let it be."""
    rows: list[list[Panel]] = [[]]
    for panel in panels:
        if rows[-1] and _row_in([*rows[-1], panel]) > page_in:
            rows.append([])
        rows[-1].append(panel)
    return rows


def _row_in(row: Sequence[Panel]) -> float:
    return sum(map(_width_in, row))


def _width_in(panel: Panel) -> float:
    """What a panel needs, in inches."""
    densest = max(Counter(i.column for i in panel.intervals).values(), default=1)
    longest = max((len(line) for name in _columns(panel) for line in name.splitlines()), default=0)
    name_in = (min(longest, _LEAST_LETTERS) + 1) / _LETTERS_PER_INCH
    return len(_columns(panel)) * max(name_in, _INTERVAL_IN * (densest + 1)) + _SIDES_IN


def _panes(part: SubFigure, row: Sequence[Panel]) -> Sequence[Axes]:
    widths = [_width_in(panel) for panel in row]
    panes: Sequence[Axes] = part.subplots(1, len(row), squeeze=False, width_ratios=widths)[0]
    return panes


def _name_columns(axes: Axes, panel: Panel, letters: int) -> None:
    """Write the names of the columns, in lines of limited length: a path may be long."""
    most = max(letters, _LEAST_LETTERS)
    names = [
        "\n".join(line for part in name.splitlines() for line in wrap(part, most))
        for name in _columns(panel)
    ]
    axes.set_xticks(range(len(names)), [literal(name) for name in names])


def _write_scales(panes: Sequence[Axes], row: Sequence[Panel]) -> None:
    """The axis of rewards, and where it is solved, once for neighbours of one scale."""
    panes[0].set_ylabel("mean reward, 95 % interval")
    for index, (axes, panel) in enumerate(zip(panes, row, strict=True)):
        if index and row[index - 1].scale == panel.scale:
            axes.tick_params(labelleft=False)
        follows = index + 1 < len(row) and row[index + 1].scale == panel.scale
        if panel.solved is not None and not follows:
            axes.annotate(
                f"{panel.solved:g}".replace("-", "−"),
                (1.0, panel.solved),
                xycoords=("axes fraction", "data"),
                xytext=(3, 0),
                textcoords="offset points",
                va="center",
                fontsize="medium",
                color="0.4",
                annotation_clip=False,
            )


def _draw(
    axes: Axes,
    panel: Panel,
    labels: list[str],
    groups: list[str],
    variants: list[str],
    style: Style,
) -> None:
    columns, colours = _columns(panel), style.colours
    for index, column in enumerate(columns):
        inside = [i for i in panel.intervals if i.column == column]
        inside.sort(key=lambda i: labels.index(i.label))
        offsets = (np.arange(len(inside)) - (len(inside) - 1) / 2) * _SPREAD / max(len(inside), 3)
        if index % 2:
            axes.axvspan(index - 0.5, index + 0.5, color="0.5", alpha=0.07, lw=0, zorder=0)
        for interval, offset in zip(inside, offsets, strict=True):
            variant = variants.index(interval.variant)
            colour = (
                _GREY if interval.grey else colours[groups.index(interval.group) % len(colours)]
            )
            axes.errorbar(
                index + offset,
                interval.mean,
                [[max(interval.mean - interval.low, 0)], [max(interval.high - interval.mean, 0)]],
                fmt="D" if interval.grey else _MARKERS[variant % len(_MARKERS)],
                color=colour,
                markerfacecolor=axes.get_facecolor() if variant % 2 else colour,
                elinewidth=1.0,
                label=interval.label,
                zorder=3,
            )
    if panel.ideal is not None:
        mean, low, high = panel.ideal
        line = str(axes.xaxis.label.get_color())
        axes.axhspan(low, high, color=line, alpha=0.08, lw=0, zorder=1, label=_LINES["band"])
        axes.axhline(mean, color=line, linewidth=0.8, label=_LINES["ideal"], zorder=2)
    if panel.solved is not None:
        axes.axhline(panel.solved, color="0.5", lw=0.8, ls=":", label=_LINES["solved"], zorder=2)
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y")
    axes.set_title(literal(panel.title))


def _columns(panel: Panel) -> list[str]:
    return list(dict.fromkeys(interval.column for interval in panel.intervals))


def _labels(panels: Sequence[Panel]) -> list[str]:
    """The labels of all intervals, those of a group together."""
    intervals = [interval for panel in panels for interval in panel.intervals]
    groups = list(dict.fromkeys(interval.group for interval in intervals))
    intervals.sort(key=lambda interval: (interval.grey, groups.index(interval.group)))
    return list(dict.fromkeys(interval.label for interval in intervals))
