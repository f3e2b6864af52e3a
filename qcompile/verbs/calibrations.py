"""What calibrating gives: a calibration in its file, and whether an older one still holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.errors import CalibrationError, OptionError
from qcompile.limits import CLOCK_HOURS
from qcompile.mitigation.measure import PARTS, Part
from qcompile.mitigation.misfit import misfit_warnings
from qcompile.output import check_writable
from qcompile.page.calibration import calibration_document
from qcompile.page.document import Document
from qcompile.report.calibration_values import calibration_table
from qcompile.report.figure import Figure, check_figure_path
from qcompile.report.style import AnyStyle, Style
from qcompile.report.table import Table
from qcompile.verbs.files import check_distinct, check_new
from qcompile.verbs.reports import Reported


@dataclass(frozen=True)
class CalibrationOutputs:
    """The files of a calibration: `out`, which is overwritten with `force` alone, and a figure."""

    out: Path | None = None
    force: bool = False
    plot: Path | None = None
    style: AnyStyle = None

    def check_words(self, **inputs: Path | None) -> None:
        """Nothing, if the names fit each other and those of the files that are read.

        Raises:
            FigureError: no figure has such a name, or the style cannot be read.
            OptionError: the figure's file is one of the others.
        """
        if self.plot is not None:
            check_figure_path(self.plot)
            Style.of(self.style)
        elif self.style is not None:
            raise OptionError("style is the style of plot: name a file to draw to.")
        check_distinct({**inputs, "plot": self.plot})
        check_distinct({"out": self.out, "plot": self.plot})

    def into(self, backend: str) -> CalibrationOutputs:
        """The same, with the usual name of the file of that device where none is named."""
        out = self.out or Path(f"{backend}-calibration.json")
        return replace(self, out=out)

    def check_files(self) -> None:
        """Nothing, if both files can be written.

        Raises:
            OptionError: they are the same.
            OutputError: `out` is there already, or one cannot be written.
        """
        self.check_words()
        if self.out is not None:
            check_new(self.out, "out", self.force, "It may have been paid for")
            check_writable(self.out)
        if self.plot is not None:
            check_writable(self.plot)

    def draw(self, calibration: Calibration, file: Path | None) -> None:
        """Draw the figure, if one is wanted, of the calibration that is in `file`.

        Raises:
            CalibrationError: Ctrl-C.
            OutputError: it cannot be written.
        """
        if self.plot is None:
            return
        try:
            calibration.plot(self.style).save(self.plot)
        except KeyboardInterrupt:
            where = "" if file is None else f" The calibration is in {file}."
            raise CalibrationError(f"Interrupted: {self.plot} was not drawn.{where}") from None


class CalibrationResult(Reported):
    """A calibration, the file it is in, and the plain values of `qcompile calibrate --json`."""

    def __init__(self, calibration: Calibration, values: Mapping[str, Any], file: Path | None):
        super().__init__(values)
        self.calibration, self.file = calibration, file

    def plot(self, style: AnyStyle = None) -> Figure:
        """Curves, residuals and readout errors of every qubit.

        Raises:
            FigureError: the style cannot be read.
        """
        return self.calibration.plot(style)

    def table(self) -> Table:
        """A row for each qubit."""
        return calibration_table(self.to_dict())

    def document(self, command: str) -> Document:
        values = self.to_dict()
        warnings = [*misfit_warnings(values["calibration_misfits"]), *self._warnings()]
        return calibration_document(
            self.calibration, values, self.plot, warnings=warnings, command=command
        )

    def _warnings(self) -> Sequence[str]:
        """What a reader must know first."""
        return ()


class DriftCheck(CalibrationResult):
    """A fresh calibration, and whether an older one still holds.

    `failures` says why it does not, in words; it is empty where it does.
    """

    def __init__(
        self,
        calibration: Calibration,
        values: Mapping[str, Any],
        file: Path | None,
        *,
        max_age_hours: float,
        backend: str,
    ):
        super().__init__(calibration, values, file)
        self.failures = _failures(self.to_dict(), max_age_hours)
        self._backend = backend

    def _warnings(self) -> Sequence[str]:
        if self.holds:
            return ()
        return ["\n".join((f"{self.to_dict()['check']['file']} no longer holds.", *self.failures))]

    @property
    def holds(self) -> bool:
        """Whether the older calibration is young enough and no qubit drifted."""
        return not self.failures

    def check_holds(self) -> None:
        """Nothing, if the older calibration holds.

        Raises:
            CalibrationError: it does not; the message says why.
        """
        if self.failures:
            raise CalibrationError(
                f"{self.to_dict()['check']['file']} no longer holds.",
                *self.failures,
                f"Use a new one: --backend {self._backend} --out FILE",
            )


def comparable(
    old: Calibration, device: Device, qubits: Sequence[int], parts: Sequence[Part]
) -> tuple[Part, ...]:
    """The parts to measure, by default those that `old` has counts of.

    Raises:
        CalibrationError: another device, or what cannot be compared with `old`.
    """
    if old.backend != device.name:
        raise CalibrationError(
            f"The calibration is of {old.backend}, the backend is {device.name}.",
            "Compare calibrations of one device.",
        )
    old.rows(np.array(qubits))
    counts = zip(PARTS, (old.readout_counts, old.response_counts), strict=True)
    there = {part: counted for part, counted in counts if counted is not None}
    fits = dict(zip(PARTS, (old.readout, old.response), strict=True))
    for part in parts or there:
        if part not in there:
            raise CalibrationError(
                f"The calibration has no counts of the {part}.",
                f"It has: {', '.join(there) or 'none'}.",
            )
        if fits[part] is None:
            raise CalibrationError(
                f"The calibration has no fit of its {part}: there is nothing to check.",
                *old.unfitted,
                "Calibrate anew, into another file.",
            )
        if there[part].shots is None:
            raise CalibrationError("A calibration without shots has no scatter to compare.")
    return tuple(parts or there)


def _failures(values: dict[str, Any], max_age_hours: float) -> list[str]:
    """Why the calibration that was checked does not hold."""
    check, lines = values["check"], []
    if check["age_hours"] < -CLOCK_HOURS:
        lines.append(
            f"It is from the future, by {-check['age_hours']:.1f} hours: a clock is wrong."
        )
    if check["age_hours"] > max_age_hours:
        lines.append(f"It is {check['age_hours']:.1f} hours old, more than {max_age_hours:g}.")
    if check["drifted"]:
        rows = zip(values["qubits"], check["chi_square"], strict=True)
        moved = [
            f"{row['qubit']} ({chi_square:.0f})"
            for row, chi_square in rows
            if row["qubit"] in check["drifted"]
        ]
        lines.append(
            f"Drifted: {', '.join(moved)}; in brackets chi-square, {check['degrees']} expected."
        )
    return lines
