"""Results of calibrating: a calibration and its file, and whether an older one still holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from qcompile.calibration import Calibration
from qcompile.caller import option
from qcompile.clashes import Named, check_clashes
from qcompile.device import Device
from qcompile.errors import CalibrationError, OptionError
from qcompile.limits import CLOCK_HOURS
from qcompile.mitigation.measure import PARTS, Part
from qcompile.mitigation.misfit import misfit_warnings
from qcompile.output import check_writable
from qcompile.page.calibration import calibration_document
from qcompile.page.document import Document
from qcompile.page.words import without_folders
from qcompile.report.calibration_values import calibration_table
from qcompile.report.figure import Figure, check_figure_path
from qcompile.report.style import AnyStyle
from qcompile.report.table import Table
from qcompile.report.trial import check_style
from qcompile.verbs.files import check_new
from qcompile.verbs.reports import Reported


@dataclass(frozen=True)
class CalibrationOutputs:
    """The files of a calibration: `out`, overwritten only with `force`, and a figure.

    `reads` are the files that it is made from or compared with.
    """

    out: Path | None = None
    force: bool = False
    plot: Path | None = None
    style: AnyStyle = None
    reads: Named = field(default_factory=dict)

    def check_words(self) -> None:
        """Check the file names against each other and against the files that are read.

        Raises:
            FigureError: the suffix of the figure is unknown, or nothing can be drawn in the style.
            OptionError: two names are the same file.
        """
        if self.plot is not None:
            check_figure_path(self.plot)
            if self.style is not None:
                check_style("calibration", self.style, self.plot)
        elif self.style is not None:
            raise OptionError(
                f"{option('style')} is the style of {option('plot')}: name a file to draw to."
            )
        older = [frozenset({option(name), option("out")}) for name in ("check", "from", "backend")]
        writes = {option("out"): self.out, option("plot"): self.plot}
        check_clashes(self.reads, writes, allowed=older)  # `force` protects these

    def into(self, backend: str) -> CalibrationOutputs:
        """The same outputs; `out` defaults to the usual file name for the backend."""
        out = self.out or Path(f"{backend}-calibration.json")
        return replace(self, out=out)

    def check_files(self) -> None:
        """Check that both files can be written.

        Raises:
            OptionError: they are the same file.
            OutputError: `out` already exists, or a file cannot be written.
        """
        self.check_words()
        if self.out is not None:
            check_new(self.out, "out", self.force, "It may have been paid for")
            check_writable(self.out)
        if self.plot is not None:
            check_writable(self.plot)

    def draw(self, calibration: Calibration, file: Path | None) -> None:
        """Write the figure, if requested, of the calibration that is in `file`.

        Raises:
            CalibrationError: Ctrl-C.
            OutputError: the figure cannot be written.
        """
        if self.plot is None:
            return
        try:
            calibration.plot(self.style).save(self.plot)
        except KeyboardInterrupt:
            where = "" if file is None else f" The calibration is in {file}."
            raise CalibrationError(f"Interrupted: {self.plot} was not drawn.{where}") from None


class CalibrationResult(Reported):
    """A calibration, its file, and the document of `qcompile calibrate --json`."""

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
        return calibration_table(self.to_dict(), self.warnings)

    @property
    def warnings(self) -> list[str]:
        """What a reader must know before the fits."""
        return misfit_warnings(self.to_dict()["calibration_misfits"])

    def document(self, command: str) -> Document:
        return calibration_document(
            self.calibration, self.to_dict(), self.plot, warnings=self.warnings, command=command
        )


class DriftCheck(CalibrationResult):
    """A fresh calibration, and whether an older one still holds.

    `failures` lists the reasons why it does not hold; it is empty if it does.
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

    @property
    def warnings(self) -> list[str]:
        if self.holds:
            return super().warnings
        file = without_folders(self.to_dict()["check"]["file"])
        return [*super().warnings, "\n".join((f"{file} no longer holds.", *self.failures))]

    @property
    def holds(self) -> bool:
        """Whether the older calibration is recent enough and no qubit drifted."""
        return not self.failures

    def check_holds(self) -> None:
        """Check that the older calibration holds.

        Raises:
            CalibrationError: it does not hold; the message says why.
        """
        if self.failures:
            raise CalibrationError(
                f"{self.to_dict()['check']['file']} no longer holds.",
                *self.failures,
                f"Make a new one: qcompile calibrate --backend {self._backend} --out FILE",
            )


def comparable(
    old: Calibration, device: Device, qubits: Sequence[int], parts: Sequence[Part]
) -> tuple[Part, ...]:
    """The parts to measure, by default those that `old` has counts of.

    Raises:
        CalibrationError: `old` is of another device, or a part of it cannot be compared.
    """
    if old.backend != device.name:
        raise CalibrationError(
            f"The calibration is of {old.backend}, but the backend is {device.name}.",
            "Compare calibrations of the same device.",
        )
    old.rows(np.array(qubits))
    counts = zip(PARTS, (old.readout_counts, old.response_counts), strict=True)
    counted = {part: values for part, values in counts if values is not None}
    fits = dict(zip(PARTS, (old.readout, old.response), strict=True))
    for part in parts or counted:
        if part not in counted:
            raise CalibrationError(
                f"The calibration has no counts of the {part}.",
                f"It has counts of: {', '.join(counted) or 'nothing'}.",
            )
        if fits[part] is None:
            raise CalibrationError(
                f"The calibration has no fit of its {part}: there is nothing to check.",
                *old.unfitted,
                "Calibrate again, into another file.",
            )
        if counted[part].shots is None:
            raise CalibrationError(
                "The calibration was made with exact probabilities: it has no counts to compare."
            )
    return tuple(parts or counted)


def _failures(values: dict[str, Any], max_age_hours: float) -> list[str]:
    """Why the calibration that was checked does not hold."""
    check, lines = values["check"], []
    if check["age_hours"] < -CLOCK_HOURS:
        lines.append(
            f"It is dated {-check['age_hours']:.1f} hours in the future: a clock is wrong."
        )
    if check["age_hours"] > max_age_hours:
        lines.append(f"It is {check['age_hours']:.1f} hours old; the limit is {max_age_hours:g}.")
    if check["drifted"]:
        rows = zip(values["qubits"], check["chi_square"], strict=True)
        moved = [
            f"{row['qubit']} ({chi_square:.0f})"
            for row, chi_square in rows
            if row["qubit"] in check["drifted"]
        ]
        lines.append(
            f"Drifted qubits and their chi-square, {check['degrees']} expected: {', '.join(moved)}."
        )
    return lines
