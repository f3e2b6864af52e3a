"""Fits of the readout and the response of each qubit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from qcompile.arrays import FloatArray
from qcompile.calibration.counts import ROUNDING, Count
from qcompile.caller import option
from qcompile.device import Probability
from qcompile.validation import Many, Record, listed

INVERTIBLE_CONTRAST = 0.02
"""The errors of a qubit that preserves less of `<Z>` cannot be undone."""
MAX_ERROR = 0.1
"""The largest standard error of a contrast or an offset; above it more shots are needed."""
_SIGN_KNOWN = 3.0
"""The sign of a contrast counts as known if it is at least this many standard errors."""

Bounded = Annotated[float, Field(ge=-1e6, le=1e6)]
Triple = tuple[Bounded, Bounded, Bounded]
Degrees = Annotated[int, Field(ge=0, le=1_000_000)]


class ReadoutFit(Record):
    """p10 = P(1 | 0) and p01 = P(0 | 1) of each qubit, with their standard errors."""

    p10: Many[Probability]
    p01: Many[Probability]
    p10_error: Many[Probability]
    p01_error: Many[Probability]
    chi_square: Many[Count]
    degrees_of_freedom: Degrees

    @property
    def contrast(self) -> FloatArray:
        """The fraction of `<Z>` that each qubit preserves, (qubits,); negative if 0 and 1 swap."""
        return np.asarray(1.0 - np.array(self.p10) - np.array(self.p01))

    @property
    def error(self) -> FloatArray:
        """The standard error of `contrast`, and of the offset, (qubits,)."""
        return np.asarray(np.hypot(self.p10_error, self.p01_error))


class ResponseFit(Record):
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
            if contrast > 1 - abs(b) + ROUNDING:
                raise ValueError(f"the curve {b:g}, {c:g}, {s:g} leaves [-1, 1]")
        if not all(map(_is_covariance, self._covariance)):
            raise ValueError("a covariance is not symmetric, or gives a negative variance")
        return self

    @property
    def contrast(self) -> FloatArray:
        """The fraction of `<Z>` that each qubit preserves, (qubits,)."""
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
    rounding = ROUNDING * np.abs(matrix).max()
    symmetric = bool((np.abs(matrix - matrix.T) <= rounding).all())
    return symmetric and least >= -rounding and bool((matrix.diagonal() >= 0).all())


def fit_problems(fit: ReadoutFit | ResponseFit, qubits: Sequence[int]) -> list[str]:
    """Why the fit of a qubit cannot be used, and what to try; empty if every fit can be used.

    Numbers are rounded away from the limit, so that they never read as the limit itself.
    """
    part = "readout" if isinstance(fit, ReadoutFit) else "response"
    contrast, error = np.abs(fit.contrast), fit.error
    weak = [
        f"{q} ({math.floor(1e4 * c) / 1e4:g})"
        for q, c in zip(qubits, contrast, strict=True)
        if c < INVERTIBLE_CONTRAST
    ]
    if weak:
        return [
            f"The {part} of qubit {listed(weak)} preserves less than {INVERTIBLE_CONTRAST} of <Z>, "
            "so its errors cannot be undone.",
            f"Exclude it (`left_out` in the device file), or run with {option('mitigation')} none.",
        ]
    limit = np.minimum(MAX_ERROR, contrast / _SIGN_KNOWN)
    unknown = [
        f"{q} ({math.ceil(1e3 * e) / 1e3:g})"
        for q, e, most in zip(qubits, error, limit, strict=True)
        if e > most
    ]
    if unknown:
        times = math.ceil(10 * ((error / limit) ** 2).max()) / 10
        wanted = f"{MAX_ERROR} of <Z>" if error.max() > MAX_ERROR else "a third of its contrast"
        return [
            f"Too few shots: the {part} of qubit {listed(unknown)} is not known to {wanted}.",
            f"Use at least {times:g} times the shots.",
        ]
    return []
