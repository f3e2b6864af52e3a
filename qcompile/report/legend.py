"""Legends below a figure, in as few lines as fit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from qcompile.report.figure import literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

_LETTER_EM, _HANDLE_EM = 0.68, 4.0
"""The width of a letter, and that of a sample with its gaps, in font sizes."""


def legend_below(drawing: Drawing, entries: Mapping[str, Any]) -> None:
    """Set the legend of a drawing, samples by their labels, below its axes, and make room for it.

    The drawing grows by the height of the legend: the axes keep theirs.
    """
    if not entries:
        return
    width_in, height_in = drawing.get_size_inches()
    letter_in = letter_width_in("legend.fontsize")
    letters = max(int(width_in / letter_in - _HANDLE_EM / _LETTER_EM), 1)
    labels = [literal("\n".join(wrap(label, letters))) for label in entries]
    for rows in range(1, len(entries) + 1):
        legend = drawing.legend(
            [*entries.values()],
            labels,
            loc="outside lower center",
            ncols=math.ceil(len(entries) / rows),
        )
        box = legend.get_window_extent()
        if box.width <= width_in * drawing.dpi or rows == len(entries):
            drawing.set_size_inches(width_in, height_in + box.height / drawing.dpi)
            return
        legend.remove()


def letter_width_in(setting: str) -> float:
    """The width of a letter, in inches, in the font size that a setting of the style names."""
    import matplotlib as mpl
    from matplotlib.font_manager import FontProperties

    size: Any = mpl.rcParams[setting]  # type: ignore[index]
    return _LETTER_EM * FontProperties(size=size).get_size_in_points() / 72


def labelled(*axes: Any) -> dict[str, Any]:
    """What some axes show, by its labels, each once."""
    return {
        label: handle
        for one in axes
        for handle, label in zip(*one.get_legend_handles_labels(), strict=True)
    }
