"""What each way to run a policy takes, as a picture."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from qcompile.report.figure import Figure

_BLUE, _GREY = "#0072B2", "0.45"


def draw_seconds(plan: dict[str, Any]) -> Figure:
    """A bar for the QPU seconds of each way of a plan, on a logarithmic scale.

    `plan` is the document of `qcompile plan --json`. A line marks what the free plan has.
    """
    from matplotlib.figure import Figure as Drawing

    ways = plan["strategies"]
    seconds = [way["qpu_seconds"] for way in ways]
    drawing = Drawing(figsize=(6.4, 0.9 + 0.45 * len(ways)), layout="constrained")
    axes = drawing.subplots()
    bars = axes.barh([way["name"] for way in ways], seconds, color=_BLUE, height=0.6)
    axes.bar_label(bars, [f"{value:,.1f} s" for value in seconds], padding=3, fontsize=8)
    free = plan["free_seconds"]
    axes.axvline(free, color=_GREY, linewidth=1, linestyle=":", label=f"free plan, {free:g} s")
    axes.set_xscale("log")
    axes.set_xlim(min(*seconds, free) / 2, max(*seconds, free) * 8)
    axes.invert_yaxis()
    axes.set_xlabel("QPU seconds, by IBM's published estimate")
    axes.set_title(f"{plan['policy']} on {plan['backend']}", loc="left", fontsize=10)
    axes.legend(loc="lower right", frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    stream = BytesIO()
    drawing.savefig(stream, format="png", dpi=120, metadata={"Software": None})
    return Figure(stream.getvalue())
