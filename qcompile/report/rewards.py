"""The rewards of a run's episodes as a picture."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np

from qcompile.report.figure import Figure
from qcompile.report.tables import interval_words

_BLUE, _GREY = "#0072B2", "0.45"


def draw_rewards(summary: dict[str, Any]) -> Figure:
    """A bar for each episode of a run, their mean and its interval."""
    import matplotlib as mpl
    from matplotlib.figure import Figure as Drawing
    from matplotlib.ticker import MaxNLocator

    rewards = [episode["reward"] for episode in summary["episodes"]]
    with mpl.rc_context({"font.size": 9}):
        drawing = Drawing(figsize=(6.4, 3.2), layout="constrained")
        axes = drawing.subplots()
        axes.bar(np.arange(len(rewards)), rewards, color=_BLUE, width=0.8)
        if summary["mean_reward"] is not None:
            axes.axhline(summary["mean_reward"], color="black", linewidth=1, label="mean")
        if interval_words(summary):
            axes.axhspan(*summary["ci95"], color=_GREY, alpha=0.3, lw=0, label="95 % interval")
        axes.axhline(0, color=_GREY, linewidth=0.6)
        axes.set_xlabel("episode")
        axes.set_ylabel("reward")
        axes.set_title(f"{summary['policy']} on {summary['backend']}", loc="left")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
        axes.spines[["top", "right"]].set_visible(False)
        if summary["mean_reward"] is not None:
            drawing.legend(loc="outside lower center", frameon=False, fontsize=8, ncols=2)
        stream = BytesIO()
        drawing.savefig(stream, format="png", dpi=150)
    return Figure(stream.getvalue())
