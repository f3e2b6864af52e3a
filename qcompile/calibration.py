"""Calibrations: what was counted on the qubits of a device, and what was fitted to it."""

from __future__ import annotations

import math
import os
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, model_validator

from qcompile.device import Device
from qcompile.errors import CalibrationError
from qcompile.output import write_file
from qcompile.validation import Line, explain

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

FORMAT = "qcompile-calibration-1"
_ROUNDING = 1e-6

Count = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = tuple[Finite, Finite, Finite]
Shots = Annotated[int, Field(ge=1)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class ReadoutCounts(_Record):
    """Ones of each qubit after each pattern of prepared bits, (patterns, qubits) each.

    Without shots `ones` are probabilities.
    """

    prepared: tuple[tuple[Annotated[int, Field(ge=0, le=1)], ...], ...]
    ones: tuple[tuple[Count, ...], ...]
    shots: Shots | None

    @model_validator(mode="after")
    def _check(self) -> ReadoutCounts:
        if [len(row) for row in self.prepared] != [len(row) for row in self.ones]:
            raise ValueError("prepared and ones have not the same shape")
        _check_ones(self.ones, self.shots)
        return self


class ResponseCounts(_Record):
    """Ones of each qubit after sx rz(a) sx (rx(a) where it is native), (angles, qubits).

    Without shots `ones` are probabilities.
    """

    angles_rad: tuple[Finite, ...]
    ones: tuple[tuple[Count, ...], ...]
    shots: Shots | None

    @model_validator(mode="after")
    def _check(self) -> ResponseCounts:
        if len(self.angles_rad) != len(self.ones):
            raise ValueError("ones has not one row for each angle")
        _check_ones(self.ones, self.shots)
        return self


def _check_ones(ones: tuple[tuple[float, ...], ...], shots: int | None) -> None:
    most = max((max(row, default=0.0) for row in ones), default=0.0)
    if most > (shots or 1 + _ROUNDING):
        raise ValueError(f"{most:g} ones in {shots or 1} shots")


class ReadoutFit(_Record):
    """p10 = P(1 | 0) and p01 = P(0 | 1) of each qubit, with their standard errors."""

    p10: tuple[Annotated[float, Field(ge=0, le=1)], ...]
    p01: tuple[Annotated[float, Field(ge=0, le=1)], ...]
    p10_error: tuple[Count, ...]
    p01_error: tuple[Count, ...]
    chi_square: tuple[Count, ...]
    degrees_of_freedom: int

    @model_validator(mode="after")
    def _check(self) -> ReadoutFit:
        if any(p10 + p01 >= 1 for p10, p01 in zip(self.p10, self.p01, strict=False)):
            raise ValueError("p10 + p01 of a qubit is 1 or more, it tells nothing")
        return self


class ResponseFit(_Record):
    """b, c, s of each qubit's measured <Z> = b + c cos(a) + s sin(a), with their covariance.

    `chi_square` says how well the curve fits, against `degrees_of_freedom` expected.
    """

    curves: tuple[Triple, ...]
    covariance: tuple[tuple[Triple, Triple, Triple], ...]
    chi_square: tuple[Count, ...]
    degrees_of_freedom: int

    @model_validator(mode="after")
    def _check(self) -> ResponseFit:
        for b, c, s in self.curves:
            if not 0 < math.hypot(c, s) <= 1 - abs(b) + _ROUNDING:
                raise ValueError(f"the curve {b:g}, {c:g}, {s:g} is flat or leaves [-1, 1]")
        return self


class Calibration(_Record):
    """Measured on `qubits` of `device`; entry i of every list below belongs to qubits[i].

    `kind` is that of the executor it was measured on, `created` when. `unfitted` says why counts
    have no fit: they are kept all the same.
    """

    format: Literal["qcompile-calibration-1"] = "qcompile-calibration-1"
    backend: Line
    kind: Literal["ideal", "noise-model", "measured-response", "hardware"]
    created: AwareDatetime
    device: Device
    qubits: tuple[Annotated[int, Field(ge=0)], ...]
    readout_counts: ReadoutCounts | None = None
    readout: ReadoutFit | None = None
    response_counts: ResponseCounts | None = None
    response: ResponseFit | None = None
    unfitted: tuple[Line, ...] = ()

    @model_validator(mode="after")
    def _check(self) -> Calibration:
        count = len(self.qubits)
        if not count or len(set(self.qubits)) < count:
            raise ValueError("qubits must be there, each once")
        if not self.device.is_ideal and max(self.qubits) >= len(self.device.qubits):
            raise ValueError(f"{self.device.name} has no qubit {max(self.qubits)}")
        parts = (self.readout, self.readout_counts, self.response, self.response_counts)
        if not any(parts):
            raise ValueError("neither readout nor response was measured")
        for fit in (self.readout, self.response):
            if fit is not None and any(
                len(column) != count for column in vars(fit).values() if isinstance(column, tuple)
            ):
                raise ValueError(f"a fit has not one entry for each of {count} qubits")
        for counts in (self.readout_counts, self.response_counts):
            if counts is not None and any(len(row) != count for row in counts.ones):
                raise ValueError(f"a row of counts has not one entry for each of {count} qubits")
        return self

    @cached_property
    def executions(self) -> int:
        """Circuits times shots that were run for it."""
        counts = (self.readout_counts, self.response_counts)
        return sum(len(c.ones) * (c.shots or 0) for c in counts if c is not None)

    def rows(self, qubits: IntArray) -> IntArray:
        """Where each of `qubits` (n,) stands in `self.qubits`.

        Raises:
            CalibrationError: a qubit was not calibrated.
        """
        missing = np.setdiff1d(qubits, self.qubits)
        if missing.size:
            raise CalibrationError(
                f"Qubit {missing[0]} has no calibration.",
                f"Calibrated on {self.backend}: {' '.join(map(str, self.qubits))}.",
            )
        order = np.argsort(self.qubits)
        rows: IntArray = order[np.searchsorted(self.qubits, qubits, sorter=order)]
        return rows

    def age_hours(self, now: datetime) -> float:
        """Hours from its creation to `now`, which has a time zone."""
        return (now - self.created).total_seconds() / 3600

    def save(self, path: Path) -> None:
        """Write it as JSON.

        Raises:
            OutputError: the file cannot be written.
        """
        write_file(path, self.model_dump_json(indent=1).encode() + b"\n")


def load_calibration(path: Path) -> Calibration:
    """The calibration of a file.

    Raises:
        CalibrationError: there is no such file, or it is no calibration.
    """
    try:
        return Calibration.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise CalibrationError(f"{path} is no calibration.", *explain(error)) from error


def is_calibration(path: Path) -> bool:
    """Whether a file says that it is one."""
    if not os.path.isfile(path):  # unlike Path.is_file, False for a name too long to be one
        return False
    try:
        with path.open("rb") as file:
            return f'"{FORMAT}"'.encode() in file.read(200)
    except OSError:
        return False
