"""Legends below a figure, in as many columns as fit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from qcompile.report.figure import literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

_LETTER_EM, _HANDLE_EM, _LINE_EM = 0.6, 4.0, 1.5
"""The width of a letter, that of a sample with its gaps and the height of a line, in font sizes."""


def legend_below(drawing: Drawing, entries: Mapping[str, Any]) -> None:
    """Set the legend of a drawing, samples by their labels, below its axes, and make room for it.

    The drawing grows by the height of the legend: the axes keep theirs.
    """
    import matplotlib as mpl
    from matplotlib.font_manager import FontProperties

    if not entries:
        return
    em_in = FontProperties(size=mpl.rcParams["legend.fontsize"]).get_size_in_points() / 72
    width_in, height_in = drawing.get_size_inches()
    longest_in = (max(map(len, entries)) * _LETTER_EM + _HANDLE_EM) * em_in
    columns = min(max(1, int(width_in / longest_in)), len(entries))
    rows = math.ceil(len(entries) / columns)
    columns = math.ceil(len(entries) / rows)
    drawing.set_size_inches(width_in, height_in + rows * _LINE_EM * em_in)
    drawing.legend(
        [*entries.values()],
        [literal(label) for label in entries],
        loc="outside lower center",
        ncols=columns,
    )


def labelled(*axes: Any) -> dict[str, Any]:
    """What some axes show, by its labels, each once."""
    return {
        label: handle
        for one in axes
        for handle, label in zip(*one.get_legend_handles_labels(), strict=True)
    }
