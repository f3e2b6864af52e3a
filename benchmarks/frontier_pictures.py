"""The two pictures of the frontier: control rate x shots, and reward against QPU seconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from qcompile.report.figure import Figure
from qcompile.report.legend import labelled, legend_below
from qcompile.report.style import Style

MARKS = {1: "o", 2: "s", 4: "^", 8: "v"}
GREY = "0.45"
Points = Sequence[Mapping[str, Any]]


def draw_matrix(points: Points, tasks: Sequence[str], device: str, path: Path) -> None:
    """The mean reward at each number of shots (columns) and of held steps (rows), for each task."""
    style = Style.of(None)
    with style.applied():
        drawing = style.drawing(style.height_in, wide=True)
        for axes, task in zip(drawing.subplots(1, len(tasks)), tasks, strict=True):
            own = [p for p in points if (p["task"], p["device"]) == (task, device)]
            shots = sorted({p["shots"] for p in own})
            holds = [*MARKS]
            rewards = np.full((len(holds), len(shots)), np.nan)
            for p in own:
                rewards[holds.index(p["hold"]), shots.index(p["shots"])] = p["mean_reward"]
            axes.imshow(rewards, aspect="auto", cmap="cividis")
            middle = (np.nanmin(rewards) + np.nanmax(rewards)) / 2
            for (row, column), reward in np.ndenumerate(rewards):
                colour = "white" if reward < middle else "black"
                words = "-" if np.isnan(reward) else f"{reward:.0f}"
                axes.text(column, row, words, ha="center", va="center", color=colour, fontsize=7)
            axes.set_xticks(range(len(shots)), [str(count) for count in shots], rotation=90)
            axes.set_yticks(range(len(holds)), [f"1 in {hold}" for hold in holds])
            axes.set_xlabel("shots")
            axes.set_title(task)
        drawing.axes[0].set_ylabel("decisions a step")
        drawing.suptitle(f"Mean reward on {device}", x=0.01, ha="left")
    Figure(drawing, style).save(path)


def draw_seconds(
    points: Points,
    paper: Points,
    lines: Mapping[tuple[str, str], Points],
    tasks: Sequence[str],
    devices: Sequence[str],
    path: Path,
) -> None:
    """The mean reward against QPU seconds, logarithmic; the undominated points are joined."""
    style = Style.of(None)
    with style.applied():
        drawing = style.drawing(1.2 * style.height_in, wide=True)
        for axes, task in zip(drawing.subplots(1, len(tasks)), tasks, strict=True):
            for colour, device in zip(style.colours, devices, strict=False):
                own = [p for p in points if (p["task"], p["device"]) == (task, device)]
                for p in own:
                    mark = MARKS[p["hold"]]
                    axes.plot(
                        p["qpu_seconds"], p["mean_reward"], mark, color=colour, ms=2.5, alpha=0.4
                    )
                line = lines[task, device]
                x, y = ([p[key] for p in line] for key in ("qpu_seconds", "mean_reward"))
                axes.plot(x, y, color=colour, label=device)
                for p in (p for p in paper if (p["task"], p["device"]) == (task, device)):
                    axes.plot(p["qpu_seconds"], p["mean_reward"], "x", color=colour)
            axes.axvline(600, color=GREY, linestyle=":", linewidth=1)
            axes.set_xscale("log")
            axes.set_xlabel("QPU seconds of 100 episodes")
            axes.set_title(task)
        first = drawing.axes[0]
        first.set_ylabel("mean reward")
        for hold, mark in MARKS.items():
            first.plot([], [], mark, color=GREY, label=f"hold {hold}")
        first.plot([], [], "x", color=GREY, label="as in the paper")
        legend_below(drawing, labelled(first))
    Figure(drawing, style).save(path)
