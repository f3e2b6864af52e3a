"""How the rewards of episodes are distributed, as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.report.figure import Figure, literal, write_title
from qcompile.report.legend import labelled, legend_below
from qcompile.report.style import AnyStyle, Style

_BINS = (8, 36)
_MOST_TICKS = 120
"""Of more episodes than that no ticks are drawn: they would be a bar."""
_GREY = "0.5"


@dataclass(frozen=True)
class Sample:
    """The rewards of some episodes, one or more, with the 95 % interval of their mean, if any."""

    label: str
    rewards: Sequence[float]
    ci95: Sequence[float] | None = None
    grey: bool = False


def draw_distributions(
    title: str, samples: Sequence[Sample], style: AnyStyle = None, *, row_in: float = 0.55
) -> Figure:
    """A histogram for each sample, below each other on one axis of rewards.

    All have the same bins, and each its own height. Ticks are episodes, a diamond is the mean, and
    the line through it its 95 % interval.

    Raises:
        FigureError: the style cannot be read.
    """
    look = Style.of(style)
    every = np.concatenate([np.asarray(sample.rewards, dtype=float) for sample in samples])
    edges = _edges(every)
    with look.applied():
        drawing = look.drawing(0.75 + row_in * len(samples))
        axes = drawing.subplots()
        line = str(axes.xaxis.label.get_color())
        for row, sample in enumerate(samples):
            base = float(-row)
            counts, _ = np.histogram(sample.rewards, edges)
            heights = 0.52 * counts / counts.max()
            colour = _GREY if sample.grey else look.colours[0]
            axes.stairs(
                base + heights, edges, baseline=base, fill=True, color=colour, alpha=0.45, lw=0
            )
            axes.axhline(base, color=_GREY, linewidth=0.5)
            if len(sample.rewards) <= _MOST_TICKS:
                axes.vlines(
                    sample.rewards, base - 0.09, base, color=colour, linewidth=0.8, label="episode"
                )
            mean, middle = float(np.mean(sample.rewards)), base - 0.16
            axes.plot([mean], [middle], "D", color=line, markersize=3.5, label="mean", linestyle="")
            if sample.ci95 is not None:
                low, high = sample.ci95
                words = "95 % interval of the mean" if low < high else ""
                axes.hlines(middle, low, high, color=line, linewidth=1.2, label=words)
            if len(samples) > 1:
                axes.annotate(
                    literal(sample.label), (0, base + 0.67), xycoords=("axes fraction", "data"),
                    va="center", fontsize="small",
                )  # fmt: skip
        axes.set_ylim(-len(samples) + 0.76, 0.8)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        axes.set_xlabel("reward of an episode")
        if title:
            write_title(drawing, title)
        legend_below(drawing, labelled(axes))
    return Figure(drawing, look)


def _edges(rewards: FloatArray) -> FloatArray:
    """The edges of bins that hold all of the rewards."""
    low, high = float(rewards.min()), float(rewards.max())
    if low == high:
        return low + np.array([-0.5, -0.1, 0.1, 0.5])
    least, most = _BINS
    automatic = len(np.histogram_bin_edges(rewards, "auto")) - 1
    return np.linspace(low, high, min(max(automatic, least), most) + 1)
