"""What each way to run a policy takes, as a figure."""

from __future__ import annotations

from typing import Any

from qcompile.report.figure import Figure, write_title
from qcompile.report.legend import labelled, legend_below
from qcompile.report.style import AnyStyle, Style

_BAR_IN, _BESIDES_IN = 0.26, 0.75


def draw_seconds(plan: dict[str, Any], style: AnyStyle = None) -> Figure:
    """A bar for the QPU seconds of each way of a plan, on a logarithmic scale.

    `plan` is the document of `qcompile plan --json`. A line marks what the free plan has.

    Raises:
        FigureError: the style cannot be read.
    """
    look = Style.of(style)
    ways = plan["strategies"]
    seconds = [way["qpu_seconds"] for way in ways]
    with look.applied():
        drawing = look.drawing(_BESIDES_IN + _BAR_IN * len(ways))
        axes = drawing.subplots()
        names = [way["name"] for way in ways]
        axes.barh(names, seconds, color=look.colours[0], height=0.6)
        free = plan["free_seconds"]
        for name, value in zip(names, seconds, strict=True):  # beside the line, in a column
            axes.annotate(f"{value:,.1f} s", (max(*seconds, free) * 1.4, name), va="center")
        axes.axvline(free, color="0.4", linewidth=1, linestyle=":", label=f"free plan, {free:g} s")
        axes.set_xscale("log")
        axes.set_xlim(min(*seconds, free) / 2, max(*seconds, free) * 20)
        axes.invert_yaxis()
        axes.set_xlabel("QPU seconds,\nby IBM's published estimate")
        write_title(drawing, f"{plan['policy']} on {plan['backend']}")
        legend_below(drawing, labelled(axes))
    return Figure(drawing, look)
