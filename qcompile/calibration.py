"""Calibrations: what was counted on the qubits of a device, and what was fitted to it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from datetime import datetime
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, model_validator

from qcompile.arrays import FloatArray, IntArray
from qcompile.device import Device, Probability
from qcompile.errors import CalibrationError
from qcompile.limits import CALIBRATION_HOURS, CLOCK_HOURS, MAX_SHOTS
from qcompile.output import write_file
from qcompile.reading import ContentsError, load_json, read_file, read_json
from qcompile.validation import Line, Many, explain, listed

if TYPE_CHECKING:
    from qcompile.report.figure import Figure

INVERTIBLE_CONTRAST = 0.02
"""A qubit that shows less of `<Z>` cannot be undone."""
MOST_ERROR = 0.1
"""A contrast, or an offset, that is known less well needs more shots."""
_SURE = 3.0
"""The sign of a contrast is known where it is so many standard errors."""
MARK = b'"qcompile-calibration-'
_ROUNDING = 1e-6

Count = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Bounded = Annotated[float, Field(ge=-1e6, le=1e6)]
Triple = tuple[Bounded, Bounded, Bounded]
Shots = Annotated[int, Field(ge=1, le=MAX_SHOTS)]
Degrees = Annotated[int, Field(ge=0, le=1_000_000)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class ReadoutCounts(_Record):
    """Ones of each qubit after each pattern of prepared bits, (patterns, qubits) each.

    Without shots `ones` are probabilities.
    """

    prepared: Many[Many[Annotated[int, Field(ge=0, le=1)]]]
    ones: Many[Many[Count]]
    shots: Shots | None

    @model_validator(mode="after")
    def _check(self) -> ReadoutCounts:
        if [len(row) for row in self.prepared] != [len(row) for row in self.ones]:
            raise ValueError("prepared and ones have not the same shape")
        if not self.ones or any(set(bits) != {0, 1} for bits in zip(*self.prepared, strict=False)):
            raise ValueError("a qubit was not prepared in both |0> and |1>")
        _check_ones(self.ones, self.shots)
        return self


class ResponseCounts(_Record):
    """Ones of each qubit after sx rz(a) sx (rx(a) where it is native), (circuits, qubits).

    `angles_rad` has the angle of each circuit and qubit, or of each circuit where all qubits were
    turned alike, as earlier files have it. Without shots `ones` are probabilities.
    """

    angles_rad: Many[Finite] | Many[Many[Finite]]
    ones: Many[Many[Count]]
    shots: Shots | None

    @model_validator(mode="after")
    def _check(self) -> ResponseCounts:
        if len(self.angles_rad) != len(self.ones) or not self.ones:
            raise ValueError("ones has not one row for each angle, of which there is one at least")
        for angles, ones in zip(self.angles_rad, self.ones, strict=True):
            if isinstance(angles, tuple) and len(angles) != len(ones):
                raise ValueError("a row of angles_rad has not one angle for each qubit")
        _check_ones(self.ones, self.shots)
        return self

    @property
    def angles(self) -> FloatArray:
        """The angle of each circuit and qubit, (circuits, qubits)."""
        angles = np.array(self.angles_rad)
        angles = angles if angles.ndim == 2 else angles[:, None]
        return np.broadcast_to(angles, np.shape(self.ones)).copy()


def _check_ones(ones: tuple[tuple[float, ...], ...], shots: int | None) -> None:
    most = max((max(row, default=0.0) for row in ones), default=0.0)
    if most > (shots or 1 + _ROUNDING):
        raise ValueError(f"{most:g} ones in {shots or 1} shots")


class ReadoutFit(_Record):
    """p10 = P(1 | 0) and p01 = P(0 | 1) of each qubit, with their standard errors."""

    p10: Many[Probability]
    p01: Many[Probability]
    p10_error: Many[Probability]
    p01_error: Many[Probability]
    chi_square: Many[Count]
    degrees_of_freedom: Degrees

    @property
    def contrast(self) -> FloatArray:
        """How much of `<Z>` is left of each qubit, (qubits,); negative where 0 and 1 swap."""
        return np.asarray(1.0 - np.array(self.p10) - np.array(self.p01))

    @property
    def error(self) -> FloatArray:
        """The standard error of `contrast`, and of the offset, (qubits,)."""
        return np.asarray(np.hypot(self.p10_error, self.p01_error))


class ResponseFit(_Record):
    """b, c, s of each qubit's measured `<Z>` = b + c cos(a) + s sin(a), with their covariance.

    `chi_square` says how well the curve fits, against `degrees_of_freedom` expected.
    """

    curves: Many[Triple]
    covariance: Many[tuple[Triple, Triple, Triple]]
    chi_square: Many[Count]
    degrees_of_freedom: Degrees

    @model_validator(mode="after")
    def _check(self) -> ResponseFit:
        for (b, c, s), contrast in zip(self.curves, self.contrast, strict=True):
            if contrast > 1 - abs(b) + _ROUNDING:
                raise ValueError(f"the curve {b:g}, {c:g}, {s:g} leaves [-1, 1]")
        if not all(map(_is_covariance, self._covariance)):
            raise ValueError("a covariance is not symmetric, or gives a negative variance")
        return self

    @property
    def contrast(self) -> FloatArray:
        """How much of `<Z>` is left of each qubit, (qubits,)."""
        _, c, s = np.array(self.curves).reshape(-1, 3).T
        return np.asarray(np.hypot(c, s))

    @property
    def error(self) -> FloatArray:
        """The larger of the standard errors of `contrast` and of the offset b, (qubits,)."""
        curves, covariance = np.array(self.curves), self._covariance
        along = curves[:, 1:] / np.maximum(self.contrast, 1e-12)[:, None]
        contrast = np.einsum("qi,qij,qj->q", along, covariance[:, 1:, 1:], along)
        return np.asarray(np.sqrt(np.maximum(contrast, covariance[:, 0, 0])))

    @property
    def _covariance(self) -> FloatArray:
        return np.array(self.covariance).reshape(-1, 3, 3)


def _is_covariance(matrix: FloatArray) -> bool:
    least: float = np.linalg.eigvalsh(matrix).min()
    rounding = _ROUNDING * np.abs(matrix).max()
    symmetric = bool((np.abs(matrix - matrix.T) <= rounding).all())
    return symmetric and least >= -rounding and bool((matrix.diagonal() >= 0).all())


def weakness(fit: ReadoutFit | ResponseFit, qubits: Sequence[int]) -> list[str]:
    """Why the fit of a qubit undoes nothing, and what to try; empty where every fit does.

    Numbers are rounded towards the failing side, so that they never read as the limit itself.
    """
    part = "readout" if isinstance(fit, ReadoutFit) else "response"
    kept, error = np.abs(fit.contrast), fit.error
    weak = [
        f"{q} ({math.floor(1e4 * c) / 1e4:g})"
        for q, c in zip(qubits, kept, strict=True)
        if c < INVERTIBLE_CONTRAST
    ]
    if weak:
        return [
            f"The {part} of qubit {listed(weak)} shows less than {INVERTIBLE_CONTRAST} of <Z>: its "
            "errors cannot be undone.",
            "Leave it out (`left_out` in the device file), or run with --mitigation none.",
        ]
    limit = np.minimum(MOST_ERROR, kept / _SURE)
    unknown = [
        f"{q} ({math.ceil(1e3 * e) / 1e3:g})"
        for q, e, most in zip(qubits, error, limit, strict=True)
        if e > most
    ]
    if unknown:
        times = math.ceil(10 * ((error / limit) ** 2).max()) / 10
        wanted = f"{MOST_ERROR} of <Z>" if error.max() > MOST_ERROR else "a third of what it shows"
        return [
            f"Too few shots: the {part} of qubit {listed(unknown)} is not known to {wanted}.",
            f"Take {times:g} times the shots or more.",
        ]
    return []


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
            raise ValueError("qubits must be there, each once")
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
                raise ValueError(f"a fit has not one entry for each of {count} qubits")
            if fit is not None and (words := weakness(fit, self.qubits)):
                raise ValueError(words[0])
        for counts in (self.readout_counts, self.response_counts):
            if counts is not None and any(len(row) != count for row in counts.ones):
                raise ValueError(f"a row of counts has not one entry for each of {count} qubits")
        return self

    @cached_property
    def executions(self) -> int:
        """Circuits times shots that were run for it."""
        counts = (self.readout_counts, self.response_counts)
        return sum(len(c.ones) * (c.shots or 0) for c in counts if c is not None)

    @property
    def mitigation(self) -> str:
        """The mitigation it serves: `readout`, unless it knows responses alone."""
        return "response" if self.readout is None and self.response is not None else "readout"

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
                "Calibrate it too (`qcompile calibrate --policy` measures a policy's qubits).",
            )
        order = np.argsort(self.qubits)
        rows: IntArray = order[np.searchsorted(self.qubits, qubits, sorter=order)]
        return rows

    def age_hours(self, now: datetime) -> float:
        """Hours from its creation to `now`, which has a time zone."""
        return (now - self.created).total_seconds() / 3600

    def plot(self) -> Figure:
        """Response curves, residuals and readout errors of every qubit as a picture."""
        from qcompile.report.calibration import draw_calibration
        from qcompile.report.figure import Figure

        return Figure(draw_calibration(self))

    def __repr__(self) -> str:
        measured = {"readout": self.readout_counts, "response": self.response_counts}
        parts = " and ".join(part for part, counts in measured.items() if counts is not None)
        qubits = "1 qubit" if len(self.qubits) == 1 else f"{len(self.qubits)} qubits"
        return f"Calibration({self.backend}, {qubits}, {parts}, {self.created:%Y-%m-%d %H:%M} UTC)"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        from qcompile.report.calibration_values import calibration_html

        return calibration_html(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write it as JSON.

        Raises:
            OutputError: the file cannot be written.
        """
        write_file(Path(path), self.model_dump_json(indent=1).encode() + b"\n")


def load_calibration(path: str | PathLike[str]) -> Calibration:
    """The calibration of a file.

    Raises:
        CalibrationError: there is no such file, or it is no calibration.
    """
    path = Path(path)
    try:
        return Calibration.model_validate_json(read_json(path))
    except (OSError, ContentsError, ValidationError) as error:
        raise CalibrationError(f"{path} is no calibration.", *explain(error)) from error


def load_counts(path: Path) -> Calibration:
    """The calibration of a file without its fits: its counts, whatever became of them.

    Raises:
        CalibrationError: there is no such file, or it holds no counts of a calibration.
    """
    try:
        values = load_json(read_file(path))
        if isinstance(values, dict):
            values = {
                k: v for k, v in values.items() if k not in ("readout", "response", "unfitted")
            }
        return Calibration.model_validate_json(json.dumps(values))
    except (OSError, ContentsError, ValidationError) as error:
        raise CalibrationError(f"{path} holds no counts to fit.", *explain(error)) from error


def age_words(name: str, calibration: Calibration, now: datetime) -> list[str]:
    """Warnings about the age of the calibration called `name`; none where it is fresh."""
    age = calibration.age_hours(now)
    if age < -CLOCK_HOURS:
        return [f"{name} is from the future, by {-age:.0f} hours: a clock is wrong."]
    if age > CALIBRATION_HOURS:
        return [
            f"{name} is {age:.0f} hours old; `qcompile calibrate --check {name}` says whether it "
            "still holds."
        ]
    return []


def is_calibration(path: Path) -> bool:
    """Whether a file says that it is one, wherever in it."""
    if not os.path.isfile(path):  # unlike Path.is_file, False for a name too long to be one
        return False
    try:
        return MARK in read_file(path)
    except (OSError, ContentsError):
        return False
