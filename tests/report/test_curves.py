"""Learning curves, as they are in the picture."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from qcompile.report.curves import Curve, CurvePanel, draw_curves

BLUE, RED = (0x00, 0x72, 0xB2), (0xD5, 0x5E, 0x00)


def curve(mean: list[float], group: str = "a", dashed: bool = False, band: float = 0.0) -> Curve:
    values = np.array(mean)
    episodes = np.arange(1, len(mean) + 1)
    return Curve(group, group, dashed, episodes, values, values - band, values + band)


def pixels(curves: list[Curve], target: float = 50.0, **options: Any) -> np.ndarray:
    """(height, width, 3), read back."""
    drawn = draw_curves([CurvePanel("Title", curves, target, **options)])
    with Image.open(BytesIO(drawn.png)) as picture:
        assert picture.format == "PNG"
        assert "Software" not in picture.info
        return np.asarray(picture.convert("RGB")).astype(int)


def of_colour(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """(pixels, 2), rows and columns; the legend's samples, 40 pixels wide at most, are left out."""
    near = np.abs(picture - colour).max(axis=2) < 12
    near[near.sum(axis=1) < 60] = False
    return np.argwhere(near)


def line_row(picture: np.ndarray, colour: tuple[int, int, int]) -> float:
    """The row, from above, that a level line is in."""
    return float(of_colour(picture, colour)[:, 0].mean())


def target_row(picture: np.ndarray) -> int:
    """The row of the dotted line: dark begins and ends in it most often."""
    dark = picture.max(axis=2) < 225
    changes = (dark[:, 1:] != dark[:, :-1]).sum(axis=1)
    assert changes.max() > 150, "no dotted line goes across"
    return int(changes.argmax())


@pytest.mark.parametrize("count", [1, 2, 9])
def test_a_picture_of_several_curves(count: int) -> None:
    """Nine groups are more than there are colours."""
    picture = pixels([curve([i, i + 1.0, 9.0], f"group {i}") for i in range(count)])
    assert picture.shape[1:] == (1020, 3), "3.4 inches at 300 dots an inch"
    assert picture[0, 0].tolist() == [255, 255, 255]


def test_the_target_is_drawn_where_it_is() -> None:
    """A curve at 50 with a band from 0 to 100: targets at 25 and 75 are as far below and above."""
    low, high = (pixels([curve([50.0] * 9, band=50.0)], target) for target in (25.0, 75.0))
    middle = line_row(low, BLUE)
    assert line_row(high, BLUE) == middle
    assert target_row(low) - middle == pytest.approx(middle - target_row(high), abs=2)
    assert target_row(low) - middle > 60


def test_groups_share_a_colour_and_dashes_tell_them_apart() -> None:
    curves = [curve([10.0] * 9, "a"), curve([90.0] * 9, "a", True), curve([50.0] * 9, "b")]
    picture = pixels(curves, 0.0)
    blue = of_colour(picture, BLUE)
    middle = line_row(picture, RED)
    above, below = (len(blue[side]) for side in (blue[:, 0] < middle, blue[:, 0] > middle))
    assert 0.3 * below < above < 0.9 * below, "the upper one, at 90, has gaps"


def test_groups_and_dashes_are_told_apart_in_grey_print() -> None:
    curves = [curve([1.0, 2.0], "a"), curve([1.0, 2.0], "a", True), curve([1.0, 2.0], "b")]
    (axes,) = draw_curves([CurvePanel("Title", curves)])._drawing.axes
    looks = {(line.get_marker(), line.get_linestyle()) for line in axes.get_lines()}
    assert len(looks) == 3


def test_panels_stand_below_each_other_in_one_column(tmp_path: Path) -> None:
    style = tmp_path / "own.mplstyle"
    style.write_text("figure.figsize: 3.4, 2\n")
    panels = [CurvePanel(f"{i}", [curve([1.0, 2.0])]) for i in range(3)]
    wide, narrow = (draw_curves(panels, look)._drawing for look in (None, style))
    assert [round(width, 1) for width in (wide.get_figwidth(), narrow.get_figwidth())] == [7.0, 3.4]
    assert len({axes.get_subplotspec().rowspan.start for axes in wide.axes}) == 1
    assert len({axes.get_subplotspec().rowspan.start for axes in narrow.axes}) == 3


def test_the_picture_ends_where_it_is_told_to() -> None:
    """The second half is at 90: a picture of the first half does not show it."""
    step = [curve([10.0] * 50 + [90.0] * 50)]
    whole, half = pixels(step), pixels(step, most_episodes=50)
    assert line_row(whole, BLUE) < line_row(half, BLUE), "a part of it is higher"
    longest = [np.ptp(of_colour(picture, BLUE)[:, 1]) for picture in (whole, half)]
    assert min(longest) > 700, "both go across"
    assert np.ptp(of_colour(half, BLUE)[:, 0]) < 6
    same = pixels(step, most_episodes=500)
    assert np.array_equal(same, whole), "there are no more than 100 episodes"


def test_the_same_curves_are_the_same_bytes() -> None:
    first, again, other = (
        draw_curves([CurvePanel("Title", [curve([1.0, level])], 5.0)]).png
        for level in (2.0, 2.0, 3.0)
    )
    assert first == again != other
