"""A calibration: the counts measured on the qubits of a device, their fits, and its file."""

from __future__ import annotations

import json
import os
from datetime import datetime
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import AwareDatetime, Field, ValidationError, model_validator

from qcompile.arrays import IntArray
from qcompile.calibration.counts import ReadoutCounts, ResponseCounts
from qcompile.calibration.fits import ReadoutFit, ResponseFit, fit_problems
from qcompile.device import CALIBRATION_MARK, Device, Kind
from qcompile.errors import CalibrationError
from qcompile.foreign import describe
from qcompile.limits import CALIBRATION_HOURS, CLOCK_HOURS
from qcompile.output import checked_path, write_file
from qcompile.reading import ContentsError, load_json, read_file, read_json
from qcompile.validation import Line, Many, Record, explain

if TYPE_CHECKING:
    from qcompile.report.figure import Figure
    from qcompile.report.style import AnyStyle


class Calibration(Record):
    """A calibration of `qubits` of `device`; entry i of every list below belongs to qubits[i].

    `kind` is that of the executor it was measured on, `created` the time. `unfitted` says why
    counts could not be fitted; they are kept.
    """

    format: Literal["qcompile-calibration-1"] = "qcompile-calibration-1"
    backend: Line
    kind: Kind
    created: AwareDatetime
    device: Device
    qubits: Many[Annotated[int, Field(ge=0, le=1_000_000)]]
    readout_counts: ReadoutCounts | None = None
    readout: ReadoutFit | None = None
    response_counts: ResponseCounts | None = None
    response: ResponseFit | None = None
    unfitted: Many[Line] = ()

    @model_validator(mode="after")
    def _check(self) -> Calibration:
        count = len(self.qubits)
        if not count or len(set(self.qubits)) < count:
            raise ValueError("qubits must not be empty or repeated")
        if not self.device.is_ideal and max(self.qubits) >= len(self.device.qubits):
            raise ValueError(f"{self.device.name} has no qubit {max(self.qubits)}")
        if self.backend != self.device.name:
            raise ValueError(f"backend is {self.backend!r}, its device is {self.device.name!r}")
        parts = (self.readout, self.readout_counts, self.response, self.response_counts)
        if not any(parts):
            raise ValueError("neither readout nor response was measured")
        for fit in (self.readout, self.response):
            if fit is not None and any(
                len(column) != count for column in vars(fit).values() if isinstance(column, tuple)
            ):
                raise ValueError(f"a fit needs one entry for each of {count} qubits")
            if fit is not None and (words := fit_problems(fit, self.qubits)):
                raise ValueError(words[0])
        for counts in (self.readout_counts, self.response_counts):
            if counts is not None and any(len(row) != count for row in counts.ones):
                raise ValueError(f"a row of counts needs one entry for each of {count} qubits")
        return self

    @cached_property
    def executions(self) -> int:
        """The circuits times shots that were run for the calibration."""
        counts = (self.readout_counts, self.response_counts)
        return sum(len(c.ones) * (c.shots or 0) for c in counts if c is not None)

    @property
    def mitigation(self) -> str:
        """The mitigation it is for: `readout`, or `response` if it has only response curves."""
        return "response" if self.readout is None and self.response is not None else "readout"

    def rows(self, qubits: IntArray) -> IntArray:
        """The index of each of `qubits` (n,) in `self.qubits`.

        Raises:
            CalibrationError: a qubit was not calibrated.
        """
        missing = np.setdiff1d(qubits, self.qubits)
        if missing.size:
            raise CalibrationError(
                f"Qubit {missing[0]} has no calibration.",
                f"Calibrated on {self.backend}: {' '.join(map(str, self.qubits))}.",
                "Calibrate it too (`qcompile calibrate --policy` measures the qubits of a policy).",
            )
        order = np.argsort(self.qubits)
        rows: IntArray = order[np.searchsorted(self.qubits, qubits, sorter=order)]
        return rows

    def age_hours(self, now: datetime) -> float:
        """Hours from its creation to `now`, which must have a time zone."""
        return (now - self.created).total_seconds() / 3600

    def plot(self, style: AnyStyle = None) -> Figure:
        """A figure of the response curves, residuals and readout errors of every qubit.

        Raises:
            FigureError: the style cannot be read.
        """
        from qcompile.report.calibration import draw_calibration

        return draw_calibration(self, style)

    def report(self, path: str | PathLike[str]) -> None:
        """Write a page of HTML with figures, tables and settings; it opens offline.

        Raises:
            OptionError: the file does not end with .html.
            OutputError: it cannot be written.
        """
        from qcompile.page.calibration import calibration_document
        from qcompile.page.render import write_report

        file = checked_path(path)
        write_report(calibration_document(self, self.to_dict(), self.plot), file)

    def __repr__(self) -> str:
        measured = {"readout": self.readout_counts, "response": self.response_counts}
        parts = " and ".join(part for part, counts in measured.items() if counts is not None)
        qubits = "1 qubit" if len(self.qubits) == 1 else f"{len(self.qubits)} qubits"
        return f"Calibration({self.backend}, {qubits}, {parts}, {self.created:%Y-%m-%d %H:%M} UTC)"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        from qcompile.report.calibration_values import calibration_html

        return calibration_html(self)

    def to_dict(self) -> dict[str, Any]:
        """The document that `qcompile calibrate --json` prints, without the name of its file."""
        from qcompile.report.calibration_values import calibration_values

        return calibration_values(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the calibration as JSON, for `load_calibration`.

        Raises:
            OutputError: the file cannot be written.
        """
        write_file(checked_path(path), self.model_dump_json(indent=1).encode() + b"\n")


def load_calibration(path: str | PathLike[str]) -> Calibration:
    """The calibration in a file.

    Raises:
        CalibrationError: there is no such file, or it is not a calibration.
    """
    if not isinstance(path, str | PathLike):
        raise CalibrationError(f"load_calibration takes a file, found {describe(path)}.")
    path = Path(path)
    try:
        return Calibration.model_validate_json(read_json(path))
    except FileNotFoundError as error:
        raise CalibrationError(
            f"There is no calibration file {path}.",
            "Make one with `qcompile calibrate --backend NAME`, or in Python with "
            "calibration.save(FILE).",
        ) from error
    except (OSError, ContentsError, ValidationError) as error:
        raise CalibrationError(f"{path} is not a calibration.", *explain(error)) from error


def load_counts(path: Path) -> Calibration:
    """The calibration in a file without its fits: only its counts.

    Raises:
        CalibrationError: there is no such file, or it has no counts of a calibration.
    """
    try:
        values = load_json(read_file(path))
        if isinstance(values, dict):
            values = {
                k: v for k, v in values.items() if k not in ("readout", "response", "unfitted")
            }
        return Calibration.model_validate_json(json.dumps(values))
    except (OSError, ContentsError, ValidationError) as error:
        raise CalibrationError(f"{path} has no counts to fit.", *explain(error)) from error


def age_warnings(name: str, calibration: Calibration, now: datetime) -> list[str]:
    """Warnings about the age of the calibration called `name`; none if it is recent."""
    age = calibration.age_hours(now)
    if age < -CLOCK_HOURS:
        return [f"{name} is dated {-age:.0f} hours in the future: a clock is wrong."]
    if age > CALIBRATION_HOURS:
        return [
            f"{name} is {age:.0f} hours old; check it with `qcompile calibrate --check {name}`."
        ]
    return []


def is_calibration(path: Path) -> bool:
    """Whether a file contains the format name of a calibration."""
    if not os.path.isfile(path):  # unlike Path.is_file, False for too long a name
        return False
    try:
        return CALIBRATION_MARK in read_file(path)
    except (OSError, ContentsError):
        return False
