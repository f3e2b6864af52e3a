"""Figures of intervals side by side: in columns, and over the number of shots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch

from qcompile.report.figure import Figure
from qcompile.report.intervals import draw_intervals
from qcompile.report.means import Interval, Panel

POWERS = [4, 8, 16, 32, 64, 128, 256]
DEVICES = ["lima", "belem", "jakarta"]
MITIGATIONS = ["none", "readout", "response"]


def panel(
    devices: Sequence[str] = ("lima",),
    mitigations: Sequence[str] = ("none",),
    shots: Sequence[float] = (32,),
    title: str = "",
) -> Panel:
    intervals = [
        Interval(device, mitigation, f"{count} shots", -80.0, -90.0, -70.0, shots=count)
        for device in devices
        for mitigation in mitigations
        for count in shots
    ]
    return Panel(title, intervals, (-75.0, -78.0, -72.0), -100.0, "a")


def panes(figure: Figure) -> list[Axes]:
    return [axes for axes in figure._drawing.axes if axes.axison]


def looks(axes: Axes) -> list[tuple[Any, ...]]:
    """What tells the intervals of a panel apart in grey print: shape, fill and dashes."""
    lines = [container.lines[0] for container in axes.containers]
    return [
        (
            line.get_marker(),
            to_rgb(line.get_markerfacecolor()) == (1.0, 1.0, 1.0),
            str(line._dash_pattern) if line.get_linestyle() != "None" else "",
        )
        for line in lines
    ]


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure._drawing.legends[0].get_texts()]


def test_panels_that_share_an_axis_show_the_intervals_of_all() -> None:
    low, high = (
        Panel(
            name, [Interval("fake_lima", "none", "32 shots", mean, mean - 1, mean + 1)], scale="a"
        )
        for name, mean in (("low", -80.0), ("high", 200.0))
    )
    for axes in panes(draw_intervals("Both", [low, high])):
        bottom, top = axes.get_ylim()
        assert bottom < -81
        assert top > 201


@pytest.mark.parametrize("shots", [[32], [32, 256], [8, 32, 256], POWERS])
@pytest.mark.parametrize("devices", [1, 2, 3])
@pytest.mark.parametrize("mitigations", [1, 2, 3])
def test_all_of_a_panel_are_told_apart_in_grey_print(
    shots: list[float], devices: int, mitigations: int
) -> None:
    """In columns those of one device are beside each other; on an axis every line is compared."""
    figure = draw_intervals("", [panel(DEVICES[:devices], MITIGATIONS[:mitigations], shots)])
    per_column = mitigations * len(shots)
    for axes in panes(figure):
        found = looks(axes)
        compared = found[:per_column] if len(shots) < 3 else found
        assert len(set(compared)) == len(compared)


def test_many_numbers_of_shots_have_an_axis() -> None:
    """Twice the shots are the same step further; exact expectations come last."""
    (axes,) = panes(draw_intervals("", [panel(DEVICES[:2], shots=[*POWERS, math.inf])]))
    assert axes.get_xlabel() == "shots"
    assert [label.get_text() for label in axes.get_xticklabels()] == [*map(str, POWERS), "exact"]
    steps = {round(b - a, 9) for a, b in pairwise(axes.get_xticks())}
    assert len(steps) == 1
    assert len(axes.containers) == 2, "a line for each device"
    assert all(len(container.lines[0].get_xdata()) == 8 for container in axes.containers)


def test_labels_of_the_axis_have_room(tmp_path: Path) -> None:
    """In half a column every second count has a label, the last one always."""
    style = tmp_path / "own.mplstyle"
    style.write_text("figure.figsize: 3.4, 2\n")
    both = [panel(shots=POWERS, title=title) for title in ("a", "b")]
    figure = draw_intervals("", both, style)
    figure._drawing.draw_without_rendering()
    for axes in panes(figure):
        boxes = [t.get_window_extent() for t in axes.get_xticklabels() if t.get_text()]
        assert [t.get_text() for t in axes.get_xticklabels()][-1] == "256"
        assert 2 < len(boxes) < 7
        assert all(a.x1 < b.x0 for a, b in pairwise(boxes))


def test_more_than_five_lines_become_a_panel_for_each_device() -> None:
    together = draw_intervals("", [panel(DEVICES[:2], MITIGATIONS[:2], POWERS, "mine")])
    assert [axes.get_title("left") for axes in panes(together)] == ["mine"]
    assert legend(together)[:4] == ["lima", "belem", "none", "readout"]
    apart = draw_intervals("", [panel(DEVICES, MITIGATIONS[:2], POWERS, "mine")])
    assert [axes.get_title("left") for axes in panes(apart)] == [
        "mine, lima",
        "mine, belem",
        "mine, jakarta",
    ]
    assert legend(apart)[:2] == ["none", "readout"]


def test_a_legend_says_nothing_twice() -> None:
    """Mitigations and numbers of shots apart, and the ideal with its interval in one sample."""
    figure = draw_intervals("", [panel(DEVICES, MITIGATIONS[:2], [32, 256])])
    assert legend(figure) == [
        "none",
        "readout",
        "32 shots",
        "256 shots",
        "ideal, exact expectations",
        "solved",
    ]


def test_bands_are_intervals_and_no_others() -> None:
    """Columns with several intervals are parted by lines; the ideal alone is a band."""
    for mitigations, lines in ((1, 0), (2, 2)):
        (axes,) = panes(draw_intervals("", [panel(DEVICES, MITIGATIONS[:mitigations])]))
        (band,) = axes.patches
        assert band.get_xy()[1] == -78.0, "the lower end of the ideal's interval"
        upright = [line for line in axes.lines if [*line.get_xdata()] in ([0.5, 0.5], [1.5, 1.5])]
        assert len(upright) == lines


def test_an_ideal_without_scatter_has_a_line_alone() -> None:
    flat = Panel("", panel().intervals, (-75.0, -75.0, -75.0), None, "a")
    figure = draw_intervals("", [flat])
    (axes,) = panes(figure)
    assert not axes.patches
    assert legend(figure)[-1] == "ideal, exact expectations"


@pytest.mark.parametrize("order", [1, -1])
def test_the_legend_has_the_interval_of_an_ideal_that_has_one(order: int) -> None:
    """Whether the panel without one comes first or last."""
    flat = Panel("flat", panel().intervals, (-75.0, -75.0, -75.0), None, "a")
    figure = draw_intervals("", [panel(title="wide"), flat][::order])
    (legend,) = figure._drawing.legends
    handles = dict(
        zip([t.get_text() for t in legend.get_texts()], legend.legend_handles, strict=True)
    )
    assert isinstance(handles["ideal, exact expectations"], Patch)


def test_a_legend_lies_within_the_figure_in_as_few_lines_as_fit() -> None:
    figure = draw_intervals("", [panel(DEVICES, MITIGATIONS[:2], [32, 256])])
    box = figure._drawing.legends[0].get_window_extent()
    assert box.width <= figure._drawing.bbox.width
    line = 1.6 * figure._drawing.legends[0].get_texts()[0].get_size() / 72 * figure._drawing.dpi
    assert box.height < 4 * line, "six entries, in three lines at most"


@pytest.mark.parametrize(
    ("figsize", "rows"), [("7.0, 2.3", [3, 3, 3]), ("3.4, 2.3", [2] * 4 + [1])]
)
def test_the_width_of_a_style_is_kept_and_rows_are_even(
    tmp_path: Path, figsize: str, rows: list[int]
) -> None:
    style = tmp_path / "own.mplstyle"
    style.write_text(f"figure.figsize: {figsize}\n")
    nine = [panel(DEVICES, MITIGATIONS[:2], POWERS, title) for title in ("a", "b", "c")]
    figure = draw_intervals("A title", nine, style)
    assert f"{figure._drawing.get_figwidth():.1f}" == figsize[:3]
    parts = [part for part in figure._drawing.subfigs if part.axes]
    assert [sum(axes.axison for axes in part.axes) for part in parts] == rows
    assert panes(figure)[2].get_title("left").replace("\n", " ") == "a, jakarta"


def test_long_names_make_a_figure_higher_and_leave_its_panels_their_height() -> None:
    short, long = (
        draw_intervals("", [panel(shots=POWERS, title=title) for title in (name, "b", "c", "d")])
        for name in ("a", "a policy with a name " * 4)
    )
    heights = []
    for figure in (short, long):
        figure._drawing.draw_without_rendering()
        heights.append(panes(figure)[0].get_window_extent().height)
    assert long._drawing.get_figheight() > short._drawing.get_figheight() + 0.2
    assert heights[1] == pytest.approx(heights[0], rel=0.1)


def test_names_of_narrow_columns_are_written_upwards(tmp_path: Path) -> None:
    style = tmp_path / "own.mplstyle"
    style.write_text("figure.figsize: 3.4, 2.3\n")
    names = [f"fake_device_{index}" for index in range(9)]
    (narrow,) = panes(draw_intervals("", [panel(names)], style))
    (wide,) = panes(draw_intervals("", [panel(names[:2])], style))
    assert {label.get_rotation() for label in narrow.get_xticklabels()} == {90.0}
    assert {label.get_rotation() for label in wide.get_xticklabels()} == {0.0}
