"""Trial figures: what a style cannot draw is found before anything is played.

They need no more room than any figure of their kind, and have what all of them have.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from qcompile.report.curves import Curve, CurvePanel, draw_curves
from qcompile.report.figure import Figure
from qcompile.report.frontier import draw_frontier
from qcompile.report.intervals import draw_intervals
from qcompile.report.means import Interval, Panel
from qcompile.report.rewards import draw_rewards
from qcompile.report.seconds import draw_seconds
from qcompile.report.style import AnyStyle, Style

Kind: TypeAlias = Literal["calibration", "curves", "intervals", "plan", "rewards"]
"""The kinds of figures: those of `calibrate`, `train`, `evaluate`, `plan` and `run`."""

_NAMES: Mapping[str, Any] = {"policy": "p", "backend": "b", "episodes": [{"reward": 1.0}]}


def check_style(kind: Kind, style: AnyStyle, path: Path) -> None:
    """Draw the figures of a kind in the style, in the format of a file, which is not written.

    Raises:
        FigureError: the style cannot be read, or nothing can be drawn with it.
    """
    for draw in _TRIALS[kind]:
        draw(Style.of(style)).contents(path.suffix)


def _calibration(style: Style) -> Figure:
    from qcompile.execution import open_executor
    from qcompile.mitigation import calibrate
    from qcompile.report.calibration import draw_calibration

    measured = calibrate(open_executor("ideal"), [0], None, parts=("readout",))
    return draw_calibration(measured, style)


def _curves(style: Style) -> Figure:
    at, mean = np.array([1, 2]), np.array([1.0, 2.0])
    curves = [Curve("a", "a", dashed, at, mean, mean, mean) for dashed in (False, True)]
    return draw_curves([CurvePanel("p", curves)], style)


def _intervals(style: Style) -> Figure:
    panel = Panel("p", [Interval("b", "g", "v", 1.0, 0.0, 2.0)])
    return draw_intervals("p", [panel], style)


def _rewards(style: Style) -> Figure:
    return draw_rewards({**_NAMES, "mean_reward": 1.0, "ci95": None}, style)


def _seconds(style: Style) -> Figure:
    ways = [{"name": "w", "qpu_seconds": 1.0}]
    return draw_seconds({**_NAMES, "strategies": ways, "free_seconds": 600.0}, style)


def _frontier(style: Style) -> Figure:
    point = {
        "policy": "p",
        "shots": 1,
        "mean_reward": 1.0,
        "ci95": None,
        "qpu_seconds": 2.0,
        "qpu_seconds_80": (1.0, 3.0),
    }
    plan = {"frontier": [point], "recommended": None, "paper": point, "within": 4.0}
    scale = {"episodes": 1, "ideal_reward": 2.0, "random_reward": 0.0}
    return draw_frontier({**_NAMES, **plan, **scale}, style)


_TRIALS: Mapping[Kind, tuple[Callable[[Style], Figure], ...]] = {
    "calibration": (_calibration,),
    "curves": (_curves,),
    "intervals": (_intervals,),
    "plan": (_seconds, _frontier),
    "rewards": (_rewards,),
}
