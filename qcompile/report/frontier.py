"""Reward against QPU seconds, as a figure."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from qcompile.report.figure import Figure, write_title
from qcompile.report.legend import labelled, legend_below
from qcompile.report.style import AnyStyle, Style
from qcompile.report.tables import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

_GREY = "0.5"
_MARGIN = 0.08
"""What is left above and below the rewards, as a share of their range."""
_PLACES = [(side, up) for up in (-9, 9) for side in (4, -4)]
"""Where the label of a point may be, in points beside and above it."""
_FAR = 10.0
"""The paper's way is left out where it takes that many times what the others take at most."""
_FEW_DECADES = 1.5
"""On a shorter axis there is a tick at 1, 2 and 5 of each decade."""
_MARK_PT = 3.0
"""Half of a mark, which no label covers."""


def draw_frontier(plan: dict[str, Any], style: AnyStyle = None) -> Figure:
    """The mean reward of each point of a plan against its QPU seconds, on a logarithmic scale.

    `plan` is the document of `qcompile plan --within --json`. Bars are the 80 % interval of the
    seconds and the 95 % interval of the mean; the recommended point is ringed. Lines mark the limit
    and what the ideal policy and random actions earn; a cross is the paper's way. Random actions
    that earn far less than the points are left out, and so is the paper's way where it takes far
    longer: the title says how long.

    Raises:
        FigureError: the style cannot be read.
    """
    look = Style.of(style)
    with look.applied():
        drawing = look.drawing(1.2 * look.height_in)
        axes = drawing.subplots()
        _draw(axes, plan, look.colours)
        words = f"{plural(plan['episodes'], 'episode')} on {plan['backend']}; numbers are shots"
        if _is_far(plan):
            words += f"; the paper's way takes {plan['paper']['qpu_seconds']:,.0f} s"
        write_title(drawing, words)
        legend_below(drawing, labelled(axes))
        drawing.draw_without_rendering()  # the labels lie where the marks are not
        _write_shots(axes, plan)
    return Figure(drawing, look)


def _draw(axes: Axes, plan: dict[str, Any], colours: list[Any]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

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
    if not _is_far(plan):
        axes.scatter(
            paper["qpu_seconds"],
            paper["mean_reward"],
            marker="x",
            color=line,
            label=f"as in the paper, {paper['shots']} shots",
        )
    within = f"within {plan['within']:g} s"
    axes.axvline(plan["within"], color=_GREY, linestyle=":", linewidth=1, label=within)
    low, high = _limits(plan)
    for key, words, dashes in (
        ("ideal_reward", "without noise", "--"),
        ("random_reward", "random actions", "-."),
    ):
        if low < plan[key] < high:
            axes.axhline(plan[key], color=_GREY, linestyle=dashes, linewidth=0.8, label=words)
    axes.set_ylim(low, high)
    axes.set_xscale("log")
    left, right = axes.get_xlim()
    subs = (1.0, 2.0, 5.0) if math.log10(right / left) < _FEW_DECADES else (1.0,)
    axes.xaxis.set_major_locator(LogLocator(subs=subs))
    axes.xaxis.set_major_formatter("{x:,g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("QPU seconds,\nby IBM's published estimate")
    axes.set_ylabel("mean reward")


def _is_far(plan: dict[str, Any]) -> bool:
    """Whether the paper's way would stretch the axis of seconds until the rest is small."""
    most = max([plan["within"], *(point["qpu_seconds"] for point in plan["frontier"])])
    return bool(plan["paper"]["qpu_seconds"] > _FAR * most)


def _limits(plan: dict[str, Any]) -> tuple[float, float]:
    """The rewards of the axis: of the points with their intervals, and of the ideal policy.

    The paper's way is on it if it is near, random actions where they do not make the rest small.
    """
    rewards = [plan["ideal_reward"]]
    if not _is_far(plan):
        rewards.append(plan["paper"]["mean_reward"])
    for point in plan["frontier"]:
        rewards += [point["mean_reward"], *(point["ci95"] or [])]
    low, high = min(rewards), max(rewards)
    if (random := plan["random_reward"]) < low and low - random < high - low:
        low = random
    margin = _MARGIN * ((high - low) or 1.0)
    return low - margin, high + margin


def _write_shots(axes: Axes, plan: dict[str, Any]) -> None:
    """Write the shots beside each point where neither points nor other labels are.

    Points that are too close together for all labels have some, the recommended one first.
    """
    chosen = plan["recommended"] or {}
    others = [] if _is_far(plan) else [plan["paper"]]
    taken = [_mark(axes, point) for point in (*plan["frontier"], *others)]
    for point in sorted(plan["frontier"], key=lambda point: not point.items() <= chosen.items()):
        label = axes.annotate(
            f"{point['shots']}",
            (point["qpu_seconds"], point["mean_reward"]),
            (0, 0),
            textcoords="offset points",
            va="center",
        )
        if not _place(axes, label, taken):
            label.remove()


def _mark(axes: Axes, point: dict[str, Any]) -> Bbox:
    """What a point and the interval of its mean cover, in pixels."""
    from matplotlib.transforms import Bbox

    rewards = [point["mean_reward"], *(point.get("ci95") or [])]
    ends = [(point["qpu_seconds"], edge(rewards)) for edge in (min, max)]
    return Bbox(axes.transData.transform(ends)).padded(_MARK_PT * axes.figure.dpi / 72)


def _place(axes: Axes, label: Annotation, taken: list[Bbox]) -> bool:
    """Move a label to the first place within the axes that is not taken, and take it."""
    inside = axes.get_window_extent()
    for side, up in _PLACES:
        label.set_position((side, up))
        label.set_horizontalalignment("left" if side > 0 else "right")
        box = label.get_window_extent()
        is_inside = inside.count_contains(box.corners()) == 4
        if is_inside and not any(box.overlaps(other) for other in taken):
            taken.append(box)
            return True
    return False


def _ends(middle: list[float], intervals: list[list[float]]) -> list[list[float]]:
    """How far the ends of intervals lie below and above the middle."""
    pairs = list(zip(middle, intervals, strict=True))
    below = [max(value - low, 0.0) for value, (low, _) in pairs]
    return [below, [max(high - value, 0.0) for value, (_, high) in pairs]]
