"""Figures of intervals side by side."""

from __future__ import annotations

from qcompile.report.intervals import Interval, Panel, draw_intervals


def test_panels_that_share_an_axis_show_the_intervals_of_all() -> None:
    low, high = (
        Panel(
            name, [Interval("fake_lima", "none", "32 shots", mean, mean - 1, mean + 1)], scale="a"
        )
        for name, mean in (("low", -80.0), ("high", 200.0))
    )
    figure = draw_intervals("Both", [low, high])
    for axes in figure._drawing.axes:
        bottom, top = axes.get_ylim()
        assert bottom < -81
        assert top > 201
