"""Counts: how often each qubit was measured as 1, and after which preparation."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from qcompile.arrays import FloatArray
from qcompile.limits import MAX_SHOTS
from qcompile.validation import Finite, Many, Record

ROUNDING = 1e-6

Count = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Shots = Annotated[int, Field(ge=1, le=MAX_SHOTS)]


class ReadoutCounts(Record):
    """The ones of each qubit after each pattern of prepared bits, (patterns, qubits) each.

    If `shots` is None, `ones` are probabilities.
    """

    prepared: Many[Many[Annotated[int, Field(ge=0, le=1)]]]
    ones: Many[Many[Count]]
    shots: Shots | None

    @model_validator(mode="after")
    def _check(self) -> ReadoutCounts:
        if [len(row) for row in self.prepared] != [len(row) for row in self.ones]:
            raise ValueError("prepared and ones have different shapes")
        if not self.ones or any(set(bits) != {0, 1} for bits in zip(*self.prepared, strict=False)):
            raise ValueError("a qubit was not prepared in both |0> and |1>")
        _check_ones(self.ones, self.shots)
        return self


class ResponseCounts(Record):
    """The ones of each qubit after sx rz(a) sx (rx(a) where it is native), (circuits, qubits).

    `angles_rad` has the angle of each circuit and qubit, or, as in earlier files, one angle per
    circuit for all qubits. If `shots` is None, `ones` are probabilities.
    """

    angles_rad: Many[Finite] | Many[Many[Finite]]
    ones: Many[Many[Count]]
    shots: Shots | None

    @model_validator(mode="after")
    def _check(self) -> ResponseCounts:
        if len(self.angles_rad) != len(self.ones) or not self.ones:
            raise ValueError("ones needs one row for each angle, and at least one angle")
        for angles, ones in zip(self.angles_rad, self.ones, strict=True):
            if isinstance(angles, tuple) and len(angles) != len(ones):
                raise ValueError("a row of angles_rad needs one angle for each qubit")
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
    if most > (shots or 1 + ROUNDING):
        raise ValueError(f"{most:g} ones in {shots or 1} shots")
