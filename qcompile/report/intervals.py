"""Means with their intervals, in columns, as pictures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from qcompile.report.figure import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARKERS = "osD^vP"
_GREY = "0.45"
_SPREAD = 0.6
_LETTERS_PER_INCH = 12
"""Of a column's name; twelve at least are left together."""
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
    """Intervals on one axis; `ideal` (mean, low, high) and `solved` are drawn across."""

    title: str
    intervals: Sequence[Interval]
    ideal: tuple[float, float, float] | None = None
    solved: float | None = None


def draw_intervals(title: str, panels: Sequence[Panel], *, same_scale: bool = True) -> bytes:
    """The panels side by side, as the bytes of a PNG file; `same_scale` for all rewards."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = [len(_columns(panel)) for panel in panels]
    densest = max(Counter((id(p), i.column) for p in panels for i in p.intervals).values())
    width = min(max(7.0, sum(columns) * (0.5 + 0.16 * densest) + 1.2 * len(panels)), 24.0)
    figure = Figure(figsize=(width, 4.8), layout="constrained")
    letters = max(int(_LETTERS_PER_INCH * width / sum(columns)), _LETTERS_PER_INCH)
    panes = figure.subplots(
        1, len(panels), squeeze=False, sharey=same_scale, width_ratios=[n + 0.5 for n in columns]
    )[0]
    labels = _labels(panels)
    groups = list(dict.fromkeys(i.group for panel in panels for i in panel.intervals if not i.grey))
    variants = list(dict.fromkeys(i.variant for panel in panels for i in panel.intervals))
    for axes, panel in zip(panes, panels, strict=True):
        _draw(axes, panel, labels, groups, variants)
        axes.set_xticks(
            range(len(_columns(panel))), [_wrapped(name, letters) for name in _columns(panel)]
        )
    panes[0].set_ylabel("mean reward, 95 % interval")
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    entries = {
        label: handle
        for axes in panes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    order = [*(label for label in labels if label in entries), *_LINES.values()]
    present = [label for label in order if label in entries]
    figure.legend(
        [entries[label] for label in present],
        present,
        loc="outside lower center",
        frameon=False,
        fontsize=8,
        ncols=min(len(present), max(3, int(width / 2.4))),
    )
    FigureCanvasAgg(figure)
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=120, metadata={"Software": None})
    return picture.getvalue()


def _draw(
    axes: Axes, panel: Panel, labels: list[str], groups: list[str], variants: list[str]
) -> None:
    columns = _columns(panel)
    for index, column in enumerate(columns):
        inside = [i for i in panel.intervals if i.column == column]
        inside.sort(key=lambda i: labels.index(i.label))
        offsets = (np.arange(len(inside)) - (len(inside) - 1) / 2) * _SPREAD / max(len(inside), 3)
        if index % 2:
            axes.axvspan(index - 0.5, index + 0.5, color="0.965", lw=0, zorder=0)
        for interval, offset in zip(inside, offsets, strict=True):
            variant = variants.index(interval.variant)
            colour = _GREY if interval.grey else COLOURS[groups.index(interval.group) % 6]
            axes.errorbar(
                index + offset,
                interval.mean,
                [[max(interval.mean - interval.low, 0)], [max(interval.high - interval.mean, 0)]],
                fmt="D" if interval.grey else _MARKERS[variant % len(_MARKERS)],
                color=colour,
                markerfacecolor="white" if variant % 2 else colour,
                markersize=5,
                capsize=2.5,
                elinewidth=1.3,
                label=interval.label,
                zorder=3,
            )
    if panel.ideal is not None:
        mean, low, high = panel.ideal
        axes.axhspan(low, high, color="0.2", alpha=0.08, lw=0, zorder=1, label=_LINES["band"])
        axes.axhline(mean, color="0.2", linewidth=1.0, label=_LINES["ideal"], zorder=2)
    if panel.solved is not None:
        axes.axhline(panel.solved, color="0.4", lw=1.0, ls=":", label=_LINES["solved"], zorder=2)
        axes.annotate(
            f"{panel.solved:g}".replace("-", "−"),
            (1.0, panel.solved),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            color="0.4",
            annotation_clip=False,
        )
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.tick_params(axis="x", length=0, labelsize=9)
    axes.grid(axis="y", color="0.92", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_title(panel.title, loc="left", fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)


def _columns(panel: Panel) -> list[str]:
    return list(dict.fromkeys(interval.column for interval in panel.intervals))


def _wrapped(name: str, letters: int) -> str:
    """`name` in lines of so many letters: the path of a calibration file may be long."""
    return "\n".join(line for part in name.splitlines() for line in wrap(part, letters))


def _labels(panels: Sequence[Panel]) -> list[str]:
    """The labels of all intervals, those of a group together."""
    intervals = [interval for panel in panels for interval in panel.intervals]
    groups = list(dict.fromkeys(interval.group for interval in intervals))
    intervals.sort(key=lambda interval: (interval.grey, groups.index(interval.group)))
    return list(dict.fromkeys(interval.label for interval in intervals))
