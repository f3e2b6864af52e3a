"""Learning curves as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from qcompile.report.figure import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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


def draw_curves(
    title: str,
    curves: Sequence[Curve],
    target: float | None = None,
    most_episodes: int | None = None,
) -> bytes:
    """The curves over the number of episodes, as the bytes of a PNG file.

    `target`, if any, is drawn across; the picture ends at `most_episodes`.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(8.0, 5.2), layout="constrained")
    axes = figure.add_subplot()
    groups = list(dict.fromkeys(curve.group for curve in curves))
    for curve in curves:
        colour = COLOURS[groups.index(curve.group) % len(COLOURS)]
        style = "--" if curve.dashed else "-"
        axes.plot(curve.episodes, curve.mean, style, color=colour, label=curve.label, linewidth=1.6)
        axes.fill_between(curve.episodes, curve.low, curve.high, color=colour, alpha=0.1, lw=0)
    if target is not None:
        _draw_target(axes, target)
    longest = max((int(curve.episodes[-1]) for curve in curves if len(curve.episodes)), default=1)
    axes.set_xlim(0, min(longest, most_episodes or longest))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_title(title, loc="left", fontsize=11, parse_math=False)
    axes.set_xlabel("episode")
    axes.set_ylabel("average reward of the last 20 episodes")
    axes.spines[["top", "right"]].set_visible(False)
    legend = figure.legend(loc="outside lower center", frameon=False, fontsize=8, ncols=4)
    for label in legend.get_texts():
        label.set_parse_math(False)  # a dollar is a dollar
    FigureCanvasAgg(figure)
    picture = BytesIO()
    figure.savefig(picture, format="png", dpi=120, metadata={"Software": None})
    return picture.getvalue()


def _draw_target(axes: Axes, target: float) -> None:
    axes.axhline(target, color="0.5", linewidth=0.8, linestyle=":")
    axes.annotate(
        f"{target:g}",
        (1.0, target),
        xycoords=("axes fraction", "data"),
        xytext=(4, 0),
        textcoords="offset points",
        va="center",
        color="0.4",
        annotation_clip=False,
    )
