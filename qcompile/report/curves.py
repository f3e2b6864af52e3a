"""Learning curves as figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qcompile.report.figure import Figure, literal, write_title
from qcompile.report.legend import labelled, legend_below
from qcompile.report.means import MARKERS, write_height
from qcompile.report.style import AnyStyle, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PANEL_IN = 2.2
"""What a panel needs, in inches."""
_MARK_EVERY = 0.2
"""The distance of a curve's markers, of the diagonal of its panel."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A line with a band: values over episodes, none or more, `low` and `high` around them.

    Curves of one `colour` group share it; `dashed` sets one of them apart.
    """

    label: str
    group: str
    dashed: bool
    episodes: NDArray[np.intp]
    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CurvePanel:
    """Curves on one axis; `target`, if any, is drawn across, and it ends at `most_episodes`."""

    title: str
    curves: Sequence[Curve]
    target: float | None = None
    most_episodes: int | None = None


def draw_curves(panels: Sequence[CurvePanel], style: AnyStyle = None) -> Figure:
    """The curves over the number of episodes; panels stand side by side, across two columns.

    Raises:
        FigureError: the style cannot be read.
    """
    look = Style.of(style)
    columns = max(min(len(panels), int(look.page_in / _PANEL_IN)), 1)
    rows = math.ceil(len(panels) / columns)
    groups = list(dict.fromkeys(curve.group for panel in panels for curve in panel.curves))
    with look.applied():
        drawing = look.drawing(rows * look.height_in, wide=len(panels) > 1)
        panes = [*drawing.subplots(rows, columns, squeeze=False).flat]
        for axes in panes[len(panels) :]:
            axes.set_axis_off()
        for axes, panel in zip(panes, panels, strict=False):
            _draw(axes, panel, groups, look, alone=len(panels) == 1)
        if len(panels) == 1:
            write_title(drawing, panels[0].title)
        for axes in drawing.axes[::columns]:
            axes.set_ylabel("mean reward of last 20")
        legend_below(drawing, labelled(*drawing.axes))
    return Figure(drawing, look)


def _draw(axes: Axes, panel: CurvePanel, groups: list[str], style: Style, *, alone: bool) -> None:
    """Draw the curves, below their title where they do not stand `alone`."""
    from matplotlib.ticker import MaxNLocator

    colours = style.colours
    for curve in panel.curves:
        group = groups.index(curve.group)
        colour = colours[group % len(colours)]
        axes.plot(
            curve.episodes,
            curve.mean,
            color=colour,
            label=curve.label,
            linestyle="--" if curve.dashed else "-",
            marker=MARKERS[group % len(MARKERS)] if len(groups) > 1 else None,
            markerfacecolor=axes.get_facecolor() if curve.dashed else colour,
            markevery=_MARK_EVERY,
        )
        axes.fill_between(curve.episodes, curve.low, curve.high, color=colour, alpha=0.12, lw=0)
    if panel.target is not None:
        axes.axhline(panel.target, color="0.5", linewidth=0.8, linestyle=":")
        write_height(axes, panel.target)
    ends = (int(curve.episodes[-1]) for curve in panel.curves if len(curve.episodes))
    longest = max(ends, default=1)
    axes.set_xlim(0, min(longest, panel.most_episodes or longest))
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, integer=True, min_n_ticks=1))
    if not alone:
        axes.set_title(literal(panel.title))
    axes.set_xlabel("episode")
