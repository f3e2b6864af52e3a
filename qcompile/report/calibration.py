"""Calibrations as figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.calibration import Calibration, ReadoutCounts, ResponseCounts
from qcompile.report.calibration_values import bad_fits, calibration_values
from qcompile.report.figure import Figure, write_title
from qcompile.report.style import AnyStyle, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing
    from matplotlib.figure import SubFigure

_MOST_CURVES = 32
"""More qubits than that have a strip of numbers instead of a curve each."""
_MOST_TICKS = 40
_PANEL_IN = 1.15
"""The width that a curve needs, in inches."""
_CURVE_IN, _STRIP_IN = 1.15, 1.1
"""The height of a row of curves, and that of a strip."""
_GREY = "0.55"


def draw_calibration(calibration: Calibration, style: AnyStyle = None) -> Figure:
    """Response curves, residuals and readout errors of every qubit, across two columns.

    Of more than _MOST_CURVES qubits contrast, offset and tilt are drawn instead of the curves.

    Raises:
        FigureError: the style cannot be read.
    """
    look = Style.of(style)
    with look.applied():
        drawing = _draw(calibration, look)
    return Figure(drawing, look)


def _draw(calibration: Calibration, style: Style) -> Drawing:
    values = calibration_values(calibration)
    count = len(calibration.qubits)
    rows = math.ceil(count / max(int(style.page_in / _PANEL_IN), 1))
    columns = math.ceil(count / rows)
    rows *= calibration.response is not None and count <= _MOST_CURVES
    residuals = list(_residuals(calibration))
    strips = _STRIPS if calibration.response is not None and not rows else ()
    below = len(strips) + bool(residuals) + (calibration.readout is not None)
    high, low = _CURVE_IN * rows + 0.4 * bool(rows), _STRIP_IN * below + 0.2 * bool(below)
    drawing = style.drawing(high + low + 0.3, wide=True)
    heights = [part for part in (high, low) if part]
    parts = iter(drawing.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0])
    shots = values["shots"]
    detail = "exact" if shots == "exact" else f"{shots} shots of each circuit"
    title = f"{calibration.backend}, {calibration.created:%Y-%m-%d %H:%M} UTC, {detail}"
    write_title(drawing, title)
    colours = style.colours * 2
    if rows:
        part = next(parts)
        panels = part.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for index, axes in enumerate(panels.flat):
            if index < count:
                _draw_curve(axes, calibration, index, values["qubits"][index], colours)
            else:
                axes.set_axis_off()
            if index < count <= index + columns:  # nothing below it
                axes.tick_params(labelbottom=True)
        part.supxlabel("angle of rz between the sx" if _has_turn(calibration) else "angle of rx")
        part.supylabel("measured <Z>")
        found = panels[0, 0].get_legend_handles_labels()
        part.legend(*found, loc="outside upper right", ncols=3)
    if below:
        part = next(parts)
        panes = iter(part.subplots(below, 1, squeeze=False, sharex=True)[:, 0])
        for strip in strips:
            _draw_strip(next(panes), values, *strip, colours[0])
        if residuals:
            _draw_residuals(next(panes), residuals, values, colours)
        if calibration.readout is not None:
            _draw_readout(next(panes), values, colours)
        _name_qubits(part, values, colours[1])
    return drawing


def _name_qubits(part: SubFigure, values: dict[str, Any], colour: Any) -> None:
    """Number the qubits below the strips; those with a bad fit are in `colour`."""
    qubits = [row["qubit"] for row in values["qubits"]]
    doubtful = {qubit for qubit, _ in bad_fits(values)}
    every, last = _every(len(qubits)), part.axes[-1]
    ticks = qubits[::every]
    last.set_xticks(range(0, len(qubits), every), [str(qubit) for qubit in ticks])
    last.set_xlim(-0.6, len(qubits) - 0.4)
    last.set_xlabel("qubit" + ("; marked: a fit is bad" if doubtful else ""))
    for label, qubit in zip(last.get_xticklabels(), ticks, strict=True):
        if qubit in doubtful and every == 1:
            label.set(color=colour, fontweight="bold")
    for at in (at for at, qubit in enumerate(qubits) if qubit in doubtful and every > 1):
        for axes in part.axes:
            axes.axvspan(at - 0.5, at + 0.5, color=colour, alpha=0.15, lw=0, zorder=0)


def _has_turn(calibration: Calibration) -> bool:
    return calibration.device.native.angle_offset_rad != 0.0


def _curve(calibration: Calibration, index: int, angles: FloatArray) -> FloatArray:
    assert calibration.response is not None
    b, c, s = calibration.response.curves[index]
    return np.asarray(b + c * np.cos(angles) + s * np.sin(angles))


def _draw_curve(
    axes: Axes, calibration: Calibration, index: int, row: dict[str, Any], colours: Sequence[Any]
) -> None:
    turn = np.linspace(0, 2 * np.pi, 121)
    ideal = np.cos(turn - np.pi * _has_turn(calibration))
    axes.plot(turn, ideal, color="0.7", linewidth=1.0, linestyle=(0, (3, 2)), label="ideal")
    axes.plot(
        turn,
        _curve(calibration, index, turn),
        color=colours[0],
        label="fitted, with its contrast",
    )
    counts = calibration.response_counts
    if counts is not None:
        ones = np.array(counts.ones)[:, index] / (counts.shots or 1)
        at = np.mod(counts.angles[:, index], 2 * np.pi)
        axes.plot(
            at, 1 - 2 * ones, "o", color=colours[1], ms=3, mec=axes.get_facecolor(), mew=0.4,
            label="measured",
        )  # fmt: skip
    axes.set_title(f"qubit {row['qubit']}", loc="left", pad=3)
    axes.set_title(f"{row['contrast']:.3f}", loc="right", pad=3, color=colours[0])
    axes.set_xticks([0, np.pi, 2 * np.pi], ["0", "π", "2π"])
    axes.set_yticks([-1, 0, 1], ["−1", "0", "1"])
    axes.set_ylim(-1.12, 1.12)
    axes.axhline(0, color="0.9", linewidth=0.8, zorder=0)


_STRIPS = (("contrast", "contrast"), ("offset", "offset"), ("tilt_rad", "tilt, rad"))


def _every(count: int) -> int:
    """The number of qubits from one tick to the next, so that the labels do not overlap."""
    return 1 if count <= _MOST_TICKS else 10 * math.ceil(count / (10 * _MOST_TICKS))


def _draw_strip(axes: Axes, values: dict[str, Any], name: str, label: str, colour: Any) -> None:
    """One number of every qubit's response curve, with its standard error."""
    numbers = [row[name] for row in values["qubits"]]
    errors = [
        row["tilt_error_rad" if name == "tilt_rad" else f"{name}_error"] for row in values["qubits"]
    ]
    axes.errorbar(
        range(len(numbers)), numbers, errors, fmt="o", color=colour, ecolor="0.6", ms=2.5, mew=0,
        elinewidth=0.8,
    )  # fmt: skip
    if name != "contrast":
        axes.axhline(0, color=_GREY, linewidth=0.8, zorder=1)
    axes.set_ylabel(label)
    _finish(axes)


def _residuals(calibration: Calibration) -> Iterator[tuple[str, FloatArray]]:
    """(circuits, qubits) for response and readout: measured less fitted, in standard errors."""
    for part, counts in (
        ("response", calibration.response_counts),
        ("readout", calibration.readout_counts),
    ):
        if counts is None or counts.shots is None:
            continue
        frequency = np.array(counts.ones) / counts.shots
        fitted = _fitted(calibration, counts)
        p = (fitted * counts.shots + 0.5) / (counts.shots + 1)
        yield part, (frequency - fitted) / np.sqrt(p * (1 - p) / counts.shots)


def _fitted(calibration: Calibration, counts: ReadoutCounts | ResponseCounts) -> FloatArray:
    """What the fits say of the frequencies of ones, (circuits, qubits)."""
    if isinstance(counts, ResponseCounts):
        angles = counts.angles.T
        curves = [_curve(calibration, index, of_qubit) for index, of_qubit in enumerate(angles)]
        return (1 - np.array(curves).T) / 2
    assert calibration.readout is not None
    p10, p01 = np.array(calibration.readout.p10), np.array(calibration.readout.p01)
    return np.where(np.array(counts.prepared) == 1, 1 - p01, p10)


def _draw_residuals(
    axes: Axes,
    residuals: Sequence[tuple[str, FloatArray]],
    values: dict[str, Any],
    colours: Sequence[Any],
) -> None:
    axes.axhspan(-2, 2, color="0.5", alpha=0.1, lw=0, zorder=0)
    axes.axhline(0, color=_GREY, linewidth=0.8, zorder=1)
    sides = (0.0,) if len(residuals) == 1 else (-0.2, 0.2)
    for (part, residual), side in zip(residuals, sides, strict=True):
        circuits, qubits = residual.shape
        spread = 0.26 * (np.arange(circuits) / max(circuits - 1, 1) - 0.5)
        at = np.arange(qubits) + side + spread[:, None]
        colour, marker = (colours[0], "o") if part == "response" else (colours[1], "D")
        size = 2.2 if qubits <= _MOST_CURVES else 1.2
        axes.plot(at.ravel(), residual.ravel(), marker, color=colour, ms=size, mew=0, label=part)
    most = max(3.5, 1.1 * max(float(np.abs(residual).max()) for _, residual in residuals))
    axes.set_ylim(-most, most)
    axes.set_ylabel("residual /\nstandard error")
    _finish(axes)


def _draw_readout(axes: Axes, values: dict[str, Any], colours: Sequence[Any]) -> None:
    at = np.arange(len(values["qubits"]))
    names = {"p10": "p10 = P(1 | 0)", "p01": "p01 = P(0 | 1)"}
    for index, (name, label) in enumerate(names.items()):
        side, colour, alpha = (-0.2, 0.2)[index], colours[index], (0.9, 0.5)[index]
        heights = [100 * row[name] for row in values["qubits"]]
        errors = [100 * row[f"{name}_error"] for row in values["qubits"]]
        axes.bar(at + side, heights, 0.36, color=colour, label=label, alpha=alpha)
        if any(errors):
            axes.errorbar(
                at + side,
                heights,
                errors,
                fmt="none",
                ecolor=_GREY,
                capsize=1.5 if len(at) <= _MOST_CURVES else 0,
                elinewidth=0.8,
            )
    axes.set_ylim(bottom=0)
    axes.set_ylabel("readout\nerror, %")
    _finish(axes)


def _finish(axes: Axes) -> None:
    axes.tick_params(axis="x", length=0)
    axes.grid(axis="y")
    if not axes.get_legend_handles_labels()[0]:
        return
    axes.legend(
        loc="lower right", bbox_to_anchor=(1, 1), ncols=2, borderaxespad=0.1,
    )  # fmt: skip
