"""The rewards of a run's episodes as a figure."""

from __future__ import annotations

from typing import Any

import numpy as np

from qcompile.report.figure import Figure, write_title
from qcompile.report.legend import labelled, legend_below
from qcompile.report.style import AnyStyle, Style
from qcompile.report.tables import interval_words

_GREY = "0.5"


def draw_rewards(summary: dict[str, Any], style: AnyStyle = None) -> Figure:
    """A bar for each episode of a run, their mean and its interval.

    Raises:
        FigureError: the style cannot be read.
    """
    from matplotlib.ticker import MaxNLocator

    look = Style.of(style)
    rewards = [episode["reward"] for episode in summary["episodes"]]
    with look.applied():
        drawing = look.drawing(look.height_in)
        axes = drawing.subplots()
        axes.bar(np.arange(len(rewards)), rewards, color=look.colours[0], width=0.8)
        line = str(axes.xaxis.label.get_color())
        if summary["mean_reward"] is not None:
            axes.axhline(summary["mean_reward"], color=line, linewidth=1, label="mean")
        if interval_words(summary):
            low, high = summary["ci95"]
            seen = "95 % interval" if low < high else ""
            axes.axhspan(low, high, color=_GREY, alpha=0.35, lw=0, label=seen)
        axes.axhline(0, color=_GREY, linewidth=0.6)
        axes.set_xlabel("episode")
        axes.set_ylabel("reward")
        write_title(drawing, f"{summary['policy']} on {summary['backend']}")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        legend_below(drawing, labelled(axes))
    return Figure(drawing, look)
