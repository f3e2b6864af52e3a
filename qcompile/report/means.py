"""Means with their intervals on panels, and what is drawn across them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKERS = "os^vXP<>ph*"
"""Shapes that differ in grey print; the diamond is of grey intervals."""


@dataclass(frozen=True)
class Interval:
    """A mean between `low` and `high`, in the column of that name.

    Intervals of one `group` share colour and shape, of one `variant` whether they are filled;
    `grey` ones are what the others are compared with. `shots` says where it lies on an axis of
    shots: infinity is exact expectations.
    """

    column: str
    group: str
    variant: str
    mean: float
    low: float
    high: float
    grey: bool = False
    shots: float | None = None

    @property
    def label(self) -> str:
        return ", ".join(part for part in (self.group, self.variant) if part)

    @property
    def ends(self) -> list[list[float]]:
        """How far its ends lie below and above the mean."""
        return [[max(self.mean - self.low, 0)], [max(self.high - self.mean, 0)]]


@dataclass(frozen=True)
class Panel:
    """Intervals on one axis; `ideal` (mean, low, high) and `solved` are drawn across.

    Panels of one `scale` share the axis of rewards.
    """

    title: str
    intervals: Sequence[Interval]
    ideal: tuple[float, float, float] | None = None
    solved: float | None = None
    scale: str = ""

    @property
    def columns(self) -> list[str]:
        return list(dict.fromkeys(interval.column for interval in self.intervals))


def draw_across(axes: Axes, panel: Panel) -> dict[str, Any]:
    """Draw the ideal with its interval and where it is solved; samples by their labels."""
    found: dict[str, Any] = {}
    if panel.ideal is not None:
        mean, low, high = panel.ideal
        line = str(axes.xaxis.label.get_color())
        across = axes.axhline(mean, color=line, linewidth=0.8, zorder=2)
        found["ideal, exact expectations"] = (
            (axes.axhspan(low, high, color=line, alpha=0.08, lw=0, zorder=1), across)
            if low < high
            else across
        )
    if panel.solved is not None:
        found["solved"] = axes.axhline(panel.solved, color="0.5", lw=0.8, ls=":", zorder=2)
    return found


def write_height(axes: Axes, height: float) -> None:
    """Write what a line across the axes stands at, to the right of it, as a tick's label."""
    import matplotlib as mpl

    axes.annotate(
        f"{height:g}".replace("-", "−"),
        (1.0, height),
        xycoords=("axes fraction", "data"),
        xytext=(3, 0),
        textcoords="offset points",
        va="center",
        fontsize=mpl.rcParams["ytick.labelsize"],
        color="0.4",
        annotation_clip=False,
    )
