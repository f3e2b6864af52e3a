"""A map of a device: its qubits and couplings by their errors, and those that circuits use."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.device import Device
from qcompile.errors import FigureError
from qcompile.passes import Executable
from qcompile.report.figure import Figure, write_title
from qcompile.report.legend import legend_below
from qcompile.report.positions import positions_of
from qcompile.report.style import AnyStyle, Style
from qcompile.report.usage import Pair, Usage

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure as Drawing

_STEP_IN, _LEAST_STEP_IN = 0.8, 0.36
"""The length of a coupling: at most, and where a map is cut rather than made smaller."""
_MARGIN, _AROUND = 0.5, 2.2
"""What is shown around the device, and around the qubits in use of one that is cut; couplings."""
_CUT = 0.75
"""What is left of the width of a map that is worth cutting, at most."""
_RADIUS, _RADIUS_PT, _NAMED_PT = 0.3, 14.0, 2.8
"""Of a qubit: in couplings, but in points at most; and what a digit of its number needs."""
_BARS_IN, _TITLE_IN, _BAR_IN = 0.55, 0.2, 0.09
_ERRORS = ("#b4c0cc", "#e59e00", "#d45d00")
"""From the least to the greatest: seen on white and on black, and by colour-blind readers.

None is a colour of the palette, which pages change on a dark ground.
"""
_APART = 0.06
"""Between the two scales of colours, of the width of one."""
_SHARE, _FEW = 0.95, 20
"""The part of the errors that the scale of colours covers, where there are more than a few."""
_GREY = "0.45"


def draw_map(
    device: Device,
    used: Usage | None = None,
    title: str = "",
    style: AnyStyle = None,
    *,
    narrow: bool = False,
) -> Figure:
    """The qubits of a device and its couplings, coloured by their errors; those in use stand out.

    A `narrow` map is never wider than a column. Where a large device does not fit, the map is cut
    to what surrounds the qubits in use.

    Raises:
        FigureError: the device has no couplings; the style cannot be read.
    """
    if not device.couplings:
        raise FigureError(
            f"There is no map of {device.name}: it lists no couplings.",
            "Use a device that does, such as fake_lima; `qcompile backends` has them.",
        )
    look = Style.of(style)
    with look.applied():
        drawing = _Map(device, used or Usage({}, {}), look, narrow).draw(title)
    return Figure(drawing, look)


def draw_executable_map(
    executable: Executable, style: AnyStyle = None, title: str | None = None
) -> Figure:
    """The map of an executable's device, with the qubits and couplings of its circuits.

    Raises:
        FigureError: as `draw_map`.
    """
    device = executable.device
    return draw_map(device, Usage.of(executable), device.name if title is None else title, style)


class _Map:
    """A map with its scale; to be used where the style is applied."""

    def __init__(self, device: Device, used: Usage, style: Style, narrow: bool):
        self.device, self.used, self.style = device, used, style
        self.places = positions_of(device)
        low, high = self.places.min(axis=0) - _MARGIN, self.places.max(axis=0) + _MARGIN
        columns = (high - low)[0]
        self.is_wide = not narrow and columns * _STEP_IN > 2 * style.column_in
        width_in = style.page_in if self.is_wide else style.column_in
        if width_in / columns < _LEAST_STEP_IN and used.bits:
            near = self.places[[*used.bits]]
            cut_low = np.maximum(low, near.min(axis=0) - _AROUND)
            cut_high = np.minimum(high, near.max(axis=0) + _AROUND)
            if (cut_high - cut_low)[0] < _CUT * columns:
                low, high = cut_low, cut_high
        self.low, self.high = low, high
        self.step_in = min(float(width_in / (high - low)[0]), _STEP_IN)
        self.radius_pt = min(72 * _RADIUS * self.step_in, _RADIUS_PT)

    def draw(self, title: str) -> Drawing:
        (left, top), (right, bottom) = self.low, self.high
        height_in = (bottom - top) * self.step_in
        around_in = _BARS_IN + _TITLE_IN * bool(title)
        drawing = self.style.drawing(height_in + around_in, wide=self.is_wide)
        panels = drawing.subplot_mosaic(
            [["map", "map", "map"], ["readout", ".", "coupling"]],
            height_ratios=[height_in, _BAR_IN],
            width_ratios=[1, _APART, 1],
        )
        axes = panels["map"]
        axes.set_axis_off()
        axes.set_aspect("equal")
        axes.set_xlim(left, right)
        axes.set_ylim(bottom, top)
        gates = " or ".join(self.device.coupling_gates)
        scales = {
            "coupling": (self._couplings(axes), f"{gates} error, %"),
            "readout": (self._qubits(axes), "readout error, %"),
        }
        for name, (scale, label) in scales.items():
            beyond = np.max(scale.get_array()) > scale.norm.vmax  # type: ignore[arg-type]
            bar = drawing.colorbar(
                scale,
                cax=panels[name],
                orientation="horizontal",
                extend="max" if beyond else "neither",
                label=label,
            )
            assert bar.solids is not None
            bar.solids.set_edgecolor("face")  # no seams between its colours
        if title:
            write_title(drawing, title)
        legend_below(drawing, self._samples())
        return drawing

    def _couplings(self, axes: Axes) -> ScalarMappable:
        """Draw the couplings, and a broad line below those in use; the scale of their errors."""
        from matplotlib.collections import LineCollection

        errors: dict[Pair, float] = {}
        for each in self.device.couplings:
            low, high = sorted(each.qubits)
            errors[low, high] = min(errors.get((low, high), 1.0), each.error)
        chosen = [self.places[[*pair]] for pair in self.used.pairs]
        widths = self.radius_pt * np.array([0.8, 0.25])
        axes.add_collection(
            LineCollection(chosen, colors=[self._in_use], linewidths=widths[0], zorder=1)
        )
        lines, found = [self.places[[*pair]] for pair in errors], np.array([*errors.values()])
        scale = _scale(found)
        colours = scale.to_rgba(100 * found)
        axes.add_collection(LineCollection(lines, colors=colours, linewidths=widths[1], zorder=2))
        return scale

    def _qubits(self, axes: Axes) -> ScalarMappable:
        """Draw the qubits, and a broad ring around those in use; the scale of their errors."""

        def circles(qubits: Sequence[int], radius: float, width: float, **look: Any) -> None:
            """With edges of this width, both in radii; the edges end where the circle does."""
            size = (2 * radius - width) * self.radius_pt
            x, y = self.places[[*qubits]].T
            axes.scatter(x, y, s=size**2, linewidths=width * self.radius_pt, **look)

        errors = np.array([(qubit.p10 + qubit.p01) / 2 for qubit in self.device.qubits])
        scale = _scale(errors)
        for qubits, colour in (
            (self.used.measured, self._in_use),
            (self.used.passed, self._passed),
        ):
            if qubits:
                circles(qubits, 1.32, 0.0, color=[colour], zorder=3)
        every = range(len(errors))
        paper, rims = axes.get_facecolor(), scale.to_rgba(100 * errors)
        circles(every, 1.0, 0.24, color=[paper], edgecolors=rims, zorder=4)
        self._numbers(axes)
        return scale

    def _numbers(self, axes: Axes) -> None:
        inside = ((self.places > self.low) & (self.places < self.high)).all(axis=1)
        longest = len(str(len(self.places) - 1))
        ink = str(axes.xaxis.label.get_color())
        for qubit in np.flatnonzero(inside).tolist():
            is_used = qubit in self.used.bits
            if is_used or self.radius_pt >= _NAMED_PT * longest:
                x, y = self.places[qubit].tolist()
                axes.text(
                    x,
                    y,
                    str(qubit),
                    ha="center",
                    va="center_baseline",
                    fontsize="small" if self.radius_pt < _RADIUS_PT else "medium",
                    fontweight="bold" if is_used else "normal",
                    color=ink if is_used else _GREY,
                    zorder=5,
                )

    def _samples(self) -> dict[str, Any]:
        from matplotlib.lines import Line2D

        samples = {"in use": self._in_use} if self.used.bits else {}
        if self.used.passed:
            samples["for routing alone"] = self._passed
        return {word: Line2D([], [], color=c, linewidth=5) for word, c in samples.items()}

    @property
    def _in_use(self) -> Any:
        return self.style.colours[0]

    @property
    def _passed(self) -> Any:
        return self.style.colours[-2 % len(self.style.colours)]


def _scale(errors: FloatArray) -> ScalarMappable:
    """The colours of errors, in percent."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    percent = 100 * errors
    most = float(np.quantile(percent, _SHARE)) if len(percent) > _FEW else float(percent.max())
    least = min(float(percent.min()), 0.999 * most)
    colours = LinearSegmentedColormap.from_list("errors", _ERRORS, N=24)
    scale = ScalarMappable(Normalize(least, most), colours)
    scale.set_array(percent)
    return scale
