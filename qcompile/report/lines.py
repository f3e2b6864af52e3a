"""Means with their intervals over the number of shots, as lines."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from qcompile.report.legend import letter_width_in
from qcompile.report.means import MARKERS, Panel
from qcompile.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEAST_IN, _SIDES_IN = 1.7, 0.35
"""What a panel needs at least, in inches, and how much of it is beside its axis."""
_TICK_IN, _INTERVAL_IN = 0.08, 0.05
"""What a tick needs, and each interval at it."""
_MOST_LINES = 5
"""A panel with more lines than that becomes one for each device."""
_DASHES: Sequence[Any] = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
_GREY = "0.3"
_SPREAD = 0.6
"""The part of the least distance of two ticks over which the lines are spread."""


class Lines:
    """A line for each device and mitigation, in `panels` of their own.

    Dashes say the mitigation. Where a panel has several devices, marker and colour say the device;
    else it is in the title, and they say the mitigation too.
    """

    def __init__(self, panels: Sequence[Panel], style: Style):
        self._devices = _names(interval.column for panel in panels for interval in panel.intervals)
        self._mitigations = _names(i.group for panel in panels for i in panel.intervals)
        self._colours = style.colours
        count = len(self._devices)
        self._together = count > 1 and count * len(self._mitigations) <= _MOST_LINES
        self.panels = [*panels] if self._together else [one for p in panels for one in _apart(p)]

    def width_in(self, panel: Panel) -> float:
        """What a panel needs, in inches."""
        ticks = len({interval.shots for interval in panel.intervals})
        needed = ticks * _TICK_IN + len(panel.intervals) * _INTERVAL_IN
        return max(needed + _SIDES_IN, _LEAST_IN)

    def samples(self) -> dict[str, Any]:
        """Samples for a legend, by their labels."""
        from matplotlib.lines import Line2D

        found: dict[str, Any] = {}
        for device in self._devices if self._together else []:
            look = self._look(device, self._mitigations[0])
            found[device] = Line2D([], [], **(look | {"linestyle": "none"}))
        for mitigation in self._mitigations:
            look = self._look(self._devices[0], mitigation)
            if self._together:
                look |= {"marker": "", "color": _GREY}
            found[mitigation] = Line2D([], [], **look)
        return found

    def draw(self, axes: Axes, panel: Panel, width_in: float) -> None:
        """Draw one of the panels, which is `width_in` wide."""
        places = _places([interval.shots or math.inf for interval in panel.intervals])
        gap = min((b - a for a, b in pairwise(places.values())), default=1.0)
        series = dict.fromkeys((interval.column, interval.group) for interval in panel.intervals)
        for index, (device, mitigation) in enumerate(series):
            own = [i for i in panel.intervals if (i.column, i.group) == (device, mitigation)]
            own.sort(key=lambda interval: interval.shots or math.inf)
            offset = (index - (len(series) - 1) / 2) * _SPREAD * gap / max(len(series), 4)
            axes.errorbar(
                [places[interval.shots or math.inf] + offset for interval in own],
                [interval.mean for interval in own],
                [[interval.ends[end][0] for interval in own] for end in (0, 1)],
                linewidth=0.9,
                elinewidth=0.6,
                zorder=3,
                **self._look(device, mitigation),
            )
        _name_places(axes, places, gap, width_in - _SIDES_IN)
        axes.set_xlabel("shots")

    def _look(self, device: str, mitigation: str) -> dict[str, Any]:
        dash = self._mitigations.index(mitigation)
        index = self._devices.index(device) if self._together else dash
        return {
            "marker": MARKERS[index % len(MARKERS)],
            "color": self._colours[index % len(self._colours)],
            "linestyle": _DASHES[dash % len(_DASHES)],
        }


def _names(words: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(words))


def _apart(panel: Panel) -> list[Panel]:
    """A panel for each of its devices, which its title names."""
    return [
        replace(
            panel,
            title=", ".join(part for part in (panel.title, device) if part),
            intervals=[interval for interval in panel.intervals if interval.column == device],
        )
        for device in panel.columns
    ]


def _places(shots: Sequence[float]) -> dict[float, float]:
    """Where each number of shots lies on the axis, which is logarithmic; exact comes last."""
    places = {count: math.log2(count) for count in sorted(set(shots)) if math.isfinite(count)}
    if math.inf in shots:
        values = list(places.values()) or [0.0]
        steps = len(values) - 1
        places[math.inf] = values[-1] + ((values[-1] - values[0]) / steps if steps else 1.0)
    return places


def _name_places(axes: Axes, places: Mapping[float, float], gap: float, width_in: float) -> None:
    """Set a tick at each place; from the last one down, every n-th has a label, which has room."""
    low, high = min(places.values()) - 0.6 * gap, max(places.values()) + 0.6 * gap
    letter = letter_width_in("xtick.labelsize") * (high - low) / width_in
    names = {p: "exact" if math.isinf(count) else f"{count:.0f}" for count, p in places.items()}
    every = 1
    while any(
        b - a < (len(names[a]) / 2 + len(names[b]) / 2 + 1) * letter
        for b, a in pairwise([*names][::-every])
    ):
        every += 1
    labelled = set([*names][::-every])
    axes.set_xlim(low, high)
    axes.set_xticks([*names], [name if place in labelled else "" for place, name in names.items()])
