"""Figures of plans: what a limit buys, and what each way takes."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import pytest
from matplotlib.axes import Axes
from matplotlib.text import Annotation

from qcompile.report.figure import Figure
from qcompile.report.frontier import draw_frontier
from qcompile.report.seconds import draw_seconds


def point(shots: int, seconds: float, reward: float) -> dict[str, Any]:
    return {
        "policy": "p",
        "shots": shots,
        "qpu_seconds": seconds,
        "qpu_seconds_80": [0.97 * seconds, 1.03 * seconds],
        "mean_reward": reward,
        "ci95": [reward - 8, reward + 8],
    }


def plan(paper_s: float = 65_000, random: float = -178, **changes: Any) -> dict[str, Any]:
    """Two points, 128 and 192 shots, next to each other; the paper's way earns what is ideal."""
    frontier = [
        *(point(16, 60, 230), point(32, 70, 262), point(64, 95, 275)),
        *(point(128, 140, 281), point(192, 141, 281.5), point(1024, 200, 284)),
    ]
    values: dict[str, Any] = {
        "policy": "p",
        "backend": "fake_lima",
        "episodes": 20,
        "within": 600,
        "frontier": frontier,
        "recommended": frontier[3],
        "paper": {"qpu_seconds": paper_s, "mean_reward": 285, "shots": 8192},
        "ideal_reward": 285,
        "random_reward": random,
    }
    return values | changes


def axes_of(figure: Figure) -> Axes:
    (axes,) = figure._drawing.axes
    return axes


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure._drawing.legends[0].get_texts()]


def labels(axes: Axes) -> list[Annotation]:
    return [text for text in axes.texts if isinstance(text, Annotation)]


def test_the_axes_reach_as_far_as_the_points() -> None:
    """From 222 to 292; random actions and the paper's way, which takes far longer, are left out."""
    figure = draw_frontier(plan())
    axes = axes_of(figure)
    low, high = axes.get_ylim()
    assert 210 < low < 222
    assert 292 < high < 305
    assert axes.get_xlim()[1] < 1000
    assert not {"random actions", "as in the paper, 8192 shots"} & {*legend(figure)}
    title = figure._drawing._suptitle.get_text()  # type: ignore[union-attr]
    assert title.replace("\n", " ").endswith("; the paper's way takes 65,000 s")


def test_what_is_near_is_drawn() -> None:
    figure = draw_frontier(plan(paper_s=4000, random=190))
    axes = axes_of(figure)
    assert axes.get_ylim()[0] < 190
    assert axes.get_xlim()[1] > 4000
    assert {"random actions", "as in the paper, 8192 shots", "without noise"} <= {*legend(figure)}
    assert "the paper's way" not in figure._drawing._suptitle.get_text()  # type: ignore[union-attr]


@pytest.mark.parametrize("paper_s", [4000, 65_000])
def test_labels_do_not_cover_each_other_or_the_points(paper_s: float) -> None:
    figure = draw_frontier(plan(paper_s))
    figure._drawing.draw_without_rendering()
    axes = axes_of(figure)
    boxes = [label.get_window_extent() for label in labels(axes)]
    assert len(boxes) >= 4
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    middles = [
        axes.transData.transform((p["qpu_seconds"], p["mean_reward"])) for p in plan()["frontier"]
    ]
    assert not any(box.contains(*middle) for box in boxes for middle in middles)


def test_a_plan_of_which_nothing_fits_is_drawn() -> None:
    assert "recommended" not in legend(draw_frontier(plan(recommended=None)))


def test_seconds_stand_beside_the_bars_and_the_line() -> None:
    """287.7 s ends just before the line of 600 s."""
    ways = [{"name": name, "qpu_seconds": s} for name, s in (("a", 2000.0), ("b", 287.7))]
    figure = draw_seconds(
        {"policy": "p", "backend": "b", "strategies": ways, "free_seconds": 600.0}
    )
    figure._drawing.draw_without_rendering()
    axes = axes_of(figure)
    right = axes.transData.transform((2000, 0))[0]
    found = {label.get_text(): label.get_window_extent() for label in labels(axes)}
    assert [*found] == ["2,000.0 s", "287.7 s"]
    assert all(box.x0 > right for box in found.values())
    assert all(box.x1 < axes.get_window_extent().x1 for box in found.values())
