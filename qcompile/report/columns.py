"""Means with their intervals in columns, one for each device."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from qcompile.report.figure import literal
from qcompile.report.legend import letter_width_in
from qcompile.report.means import MARKERS, Interval, Panel
from qcompile.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GREY = "0.45"
_SPREAD = 0.6
_LEAST_LETTERS = 12
"""Of a column's name, which are left together."""
_FULL = 0.8
"""The part of the estimated width that letters take at least."""
_INTERVAL_IN, _SIDES_IN = 0.13, 0.35
"""What an interval needs, and what a panel needs besides its columns."""


class Columns:
    """Columns of intervals: a group has a colour and a shape, every second variant is open."""

    def __init__(self, panels: Sequence[Panel], style: Style):
        self.panels = [*panels]
        intervals = [interval for panel in panels for interval in panel.intervals]
        self._groups = list(dict.fromkeys(i.group for i in intervals))
        self._variants = list(dict.fromkeys(i.variant for i in intervals))
        self._in_order = sorted(intervals, key=self._place)
        self._colours = style.colours

    def width_in(self, panel: Panel) -> float:
        """What a panel needs, in inches."""
        densest = max(Counter(i.column for i in panel.intervals).values(), default=1)
        longest = max(
            (len(line) for name in panel.columns for line in name.splitlines()), default=0
        )
        name_in = (min(longest, _LEAST_LETTERS) + 1) * letter_width_in("xtick.labelsize")
        columns_in = len(panel.columns) * max(name_in, _INTERVAL_IN * (densest + 1))
        word = max(map(len, panel.title.split()), default=0)
        title_in = min(word, _LEAST_LETTERS) * letter_width_in("axes.titlesize")
        return max(columns_in, title_in) + _SIDES_IN

    def samples(self) -> dict[str, Any]:
        """Samples for a legend; groups and variants are apart where both are several."""
        from matplotlib.lines import Line2D

        apart = len(self._groups) > 1 and len(self._variants) > 1
        looks: dict[str, dict[str, Any]] = {}
        for interval in self._in_order:
            first = replace(interval, variant=self._variants[0]) if apart else interval
            looks.setdefault(interval.group if apart else interval.label, self._look(first))
        for interval in self._in_order if apart else []:
            looks.setdefault(interval.variant, self._look(replace(interval, grey=True)))
        return {label: Line2D([], [], linestyle="none", **look) for label, look in looks.items()}

    def draw(self, axes: Axes, panel: Panel, width_in: float) -> None:
        """Draw one of the panels, which is `width_in` wide."""
        for index, column in enumerate(panel.columns):
            inside = sorted((i for i in panel.intervals if i.column == column), key=self._place)
            count = len(inside)
            offsets = (np.arange(count) - (count - 1) / 2) * _SPREAD / max(count, 3)
            if index and len(panel.intervals) > len(panel.columns):
                axes.axvline(index - 0.5, color="0.5", alpha=0.35, linewidth=0.5, zorder=0)
            for interval, offset in zip(inside, offsets, strict=True):
                axes.errorbar(
                    index + offset,
                    interval.mean,
                    interval.ends,
                    linestyle="none",
                    elinewidth=1.0,
                    zorder=3,
                    **self._look(interval),
                )
        axes.set_xlim(-0.5, len(panel.columns) - 0.5)
        axes.tick_params(axis="x", length=0)
        _name_columns(axes, panel, width_in)

    def _place(self, interval: Interval) -> tuple[bool, int, int]:
        """The order of intervals: those of a group together, grey ones last."""
        group, variant = interval.group, interval.variant
        return interval.grey, self._groups.index(group), self._variants.index(variant)

    def _look(self, interval: Interval) -> dict[str, Any]:
        import matplotlib as mpl

        index = self._groups.index(interval.group)
        colour = _GREY if interval.grey else self._colours[index % len(self._colours)]
        is_open = self._variants.index(interval.variant) % 2
        return {
            "marker": "D" if interval.grey else MARKERS[index % len(MARKERS)],
            "color": colour,
            "markerfacecolor": mpl.rcParams["axes.facecolor"] if is_open else colour,
        }


def _name_columns(axes: Axes, panel: Panel, width_in: float) -> None:
    """Write the names of the columns in lines of limited length, upwards where they are narrow."""
    room = int((width_in - _SIDES_IN) / letter_width_in("xtick.labelsize") / len(panel.columns))
    longest = max(len(line) for name in panel.columns for line in name.splitlines())
    upwards = room < _FULL * min(longest, _LEAST_LETTERS)
    most = 2 * _LEAST_LETTERS if upwards else max(room, _LEAST_LETTERS)
    names = [
        "\n".join(line for part in name.splitlines() for line in wrap(part, most))
        for name in panel.columns
    ]
    axes.set_xticks(
        range(len(names)), [literal(name) for name in names], rotation=90 if upwards else 0
    )
