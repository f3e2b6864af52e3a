"""Reward against QPU seconds, as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from qcompile.report.figure import Figure, write_title
from qcompile.report.legend import labelled, legend_below
from qcompile.report.style import AnyStyle, Style
from qcompile.report.tables import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GREY = "0.5"


def draw_frontier(plan: dict[str, Any], style: AnyStyle = None) -> Figure:
    """The mean reward of each point of a plan against its QPU seconds, on a logarithmic scale.

    `plan` is the document of `qcompile plan --within --json`. Bars are the 80 % interval of the
    seconds and the 95 % interval of the mean; the recommended point is ringed. Lines mark the limit
    and what the ideal policy and random actions earn; a cross is the paper's way.

    Raises:
        FigureError: the style cannot be read.
    """
    look = Style.of(style)
    with look.applied():
        drawing = look.drawing(1.2 * look.height_in)
        axes = drawing.subplots()
        _draw(axes, plan, look.colours)
        words = f"{plural(plan['episodes'], 'episode')} on {plan['backend']}; numbers are shots"
        write_title(drawing, words)
        legend_below(drawing, labelled(axes))
    return Figure(drawing, look)


def _draw(axes: Axes, plan: dict[str, Any], colours: list[Any]) -> None:
    line = str(axes.xaxis.label.get_color())
    points, names = plan["frontier"], list(dict.fromkeys(p["policy"] for p in plan["frontier"]))
    seconds, rewards = ([p[key] for p in points] for key in ("qpu_seconds", "mean_reward"))
    axes.plot(seconds, rewards, color=_GREY, linewidth=1, zorder=1)
    for number, name in enumerate(names):
        own = [point for point in points if point["policy"] == name]
        x, y = ([p[key] for p in own] for key in ("qpu_seconds", "mean_reward"))
        axes.errorbar(
            x,
            y,
            xerr=_ends(x, [p["qpu_seconds_80"] for p in own]),
            yerr=_ends(y, [p["ci95"] or [p["mean_reward"]] * 2 for p in own]),
            fmt="o",
            color=colours[number % len(colours)],
            elinewidth=1,
            label=name,
        )
        for point in own:
            place = point["qpu_seconds"], point["mean_reward"]
            axes.annotate(f"{point['shots']}", place, (4, -9), textcoords="offset points")
    if (chosen := plan["recommended"]) is not None:
        axes.scatter(
            chosen["qpu_seconds"],
            chosen["mean_reward"],
            s=60,
            facecolors="none",
            edgecolors=line,
            zorder=3,
            label="recommended",
        )
    paper = plan["paper"]
    axes.scatter(
        paper["qpu_seconds"],
        paper["mean_reward"],
        marker="x",
        color=line,
        label=f"as in the paper, {paper['shots']} shots",
    )
    within = f"within {plan['within']:g} s"
    axes.axvline(plan["within"], color=_GREY, linestyle=":", linewidth=1, label=within)
    for key, words in (("ideal_reward", "without noise"), ("random_reward", "random actions")):
        axes.axhline(plan[key], color=_GREY, linestyle="--", linewidth=0.8)
        axes.annotate(
            words,
            (1, plan[key]),
            (-4, 3),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            ha="right",
            color=_GREY,
        )
    axes.set_xscale("log")
    axes.set_xlabel("QPU seconds,\nby IBM's published estimate")
    axes.set_ylabel("mean reward")


def _ends(middle: list[float], intervals: list[list[float]]) -> list[list[float]]:
    """How far the ends of intervals lie below and above the middle."""
    pairs = list(zip(middle, intervals, strict=True))
    below = [max(value - low, 0.0) for value, (low, _) in pairs]
    return [below, [max(high - value, 0.0) for value, (_, high) in pairs]]
