"""Angle tables: many affine angles as arrays, evaluated for whole batches."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from qcompile.ir.angle import Angle

Array = Any
"""A numpy array or a torch tensor; one code serves both."""


class _Linear:
    """Linear forms in a vector of symbols: values (..., symbols) to (..., forms).

    Forms of at most one symbol each, the usual case, are a gather instead of a matrix product.
    """

    def __init__(self, angles: Sequence[Angle], symbols: Sequence[str], xp: ModuleType, dtype: Any):
        position = {symbol: i for i, symbol in enumerate(symbols)}
        matrix = np.zeros((len(symbols), len(angles)))
        for column, angle in enumerate(angles):
            for symbol, coefficient in angle.terms:
                if symbol in position:
                    matrix[position[symbol], column] = coefficient
        self.is_zero = not matrix.any()
        self._index = self._scale = self._matrix = None
        if np.count_nonzero(matrix, axis=0).max(initial=0) > 1:
            self._matrix = xp.asarray(matrix, dtype=dtype)
        elif not self.is_zero:
            index = np.abs(matrix).argmax(axis=0)
            scale = np.take_along_axis(matrix, index[None], axis=0)[0]
            if len(index) != len(symbols) or (index != np.arange(len(index))).any():
                self._index = xp.asarray(index)
            if (scale != 1).any():
                self._scale = xp.asarray(scale, dtype=dtype)

    def __call__(self, values: Array) -> Array:
        if self._matrix is not None:
            return values @ self._matrix
        if self._index is not None:
            values = values[..., self._index]
        return values if self._scale is None else values * self._scale


class AngleTable:
    """Affine angles over inputs and parameters, one column each.

    `constant` (columns,) is a numpy array; `linear(x, theta)` is the rest.
    """

    def __init__(
        self,
        angles: Sequence[Angle],
        inputs: Sequence[str],
        parameters: Sequence[str],
        xp: ModuleType = np,
        dtype: Any = np.float64,
    ):
        self.constant = np.array([angle.constant for angle in angles], dtype=float)
        self._inputs = _Linear(angles, inputs, xp, dtype)
        self._parameters = _Linear(angles, parameters, xp, dtype)
        self._offset = xp.asarray(self.constant, dtype=dtype) if self.constant.any() else None

    @property
    def is_constant(self) -> bool:
        return self._inputs.is_zero and self._parameters.is_zero

    def linear(self, x: Array, theta: Array) -> Array:
        """The angles less `constant`, for x (B, inputs) and theta (parameters,).

        The shape is (B, columns), or (columns,) where no angle depends on an input. Call it only
        where `is_constant` is false.
        """
        if self._parameters.is_zero:
            return self._inputs(x)
        if self._inputs.is_zero:
            return self._parameters(theta)
        return self._inputs(x) + self._parameters(theta)

    def __call__(self, x: Array, theta: Array) -> Array:
        """The angles in radians; shapes as in `linear`."""
        if self.is_constant:
            return self.constant
        value = self.linear(x, theta)
        return value if self._offset is None else value + self._offset
