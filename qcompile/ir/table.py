"""Angle tables: many affine angles as arrays, evaluated for whole batches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from qcompile.errors import CircuitError
from qcompile.ir.angle import Angle
from qcompile.ir.turns import MODERATE_RAD, reduced_product

Array = Any
"""A numpy array or a torch tensor; the same code serves both."""

_MAX_DENSE = 1_000_000
"""The most entries of a dense matrix of linear forms."""
_SPARSE = 16
"""Forms with so many times fewer terms than there are symbols are gathered term by term."""


class _Linear:
    """Linear forms in a vector of symbols: values (..., symbols) to (..., forms).

    Forms of at most one symbol each, the usual case, use a gather instead of a matrix product. So
    do many forms of several symbols, whose matrix would be huge and nearly empty.
    """

    def __init__(self, angles: Sequence[Angle], symbols: Sequence[str], xp: ModuleType, dtype: Any):
        position = {symbol: i for i, symbol in enumerate(symbols)}
        forms = [[(position[s], c) for s, c in a.terms if s in position] for a in angles]
        most = max(map(len, forms), default=0)
        index = np.zeros((most, len(forms)), dtype=np.intp)
        scale = np.zeros((most, len(forms)))
        for column, form in enumerate(forms):
            for term, (symbol, coefficient) in enumerate(form):
                index[term, column], scale[term, column] = symbol, coefficient
        self.is_zero = most == 0
        self.largest = float(np.abs(scale).sum(axis=0).max(initial=0.0))
        """Every form is at most this times the largest value."""
        self._terms = index, scale
        self._matrix = self._gathers = None
        is_sparse = most * _SPARSE < len(symbols)
        if most > 1 and not is_sparse and len(symbols) * len(forms) <= _MAX_DENSE:
            matrix = np.zeros((len(symbols), len(forms)))
            for symbols_of_term, scale_of_term in zip(index, scale, strict=True):
                matrix[symbols_of_term, np.arange(len(forms))] += scale_of_term
            self._matrix = xp.asarray(matrix, dtype=dtype)
        else:
            self._gathers = [
                (_unless_identity(i, len(symbols), xp), _unless_ones(c, xp, dtype))
                for i, c in zip(index, scale, strict=True)
            ]

    def __call__(self, values: Array) -> Array:
        if self._matrix is not None:
            return values @ self._matrix
        total: Array = None
        for index, scale in self._gathers or ():
            term = values if index is None else values[..., index]
            term = term if scale is None else term * scale
            total = term if total is None else total + term
        return total

    def reduced(self, values: Array) -> Array:
        """The forms modulo 2 pi, exactly (numpy only)."""
        index, scale = self._terms
        terms = [reduced_product(c, values[..., i]) for i, c in zip(index, scale, strict=True)]
        return np.sum(terms, axis=0)


def _unless_identity(index: Array, symbols: int, xp: ModuleType) -> Array:
    return None if np.array_equal(index, np.arange(symbols)) else xp.asarray(index)


def _unless_ones(scale: Array, xp: ModuleType, dtype: Any) -> Array:
    return None if (scale == 1).all() else xp.asarray(scale, dtype=dtype)


class AngleTable:
    """Affine angles over inputs and parameters, one column each.

    `constant` (columns,) is a numpy array; `linear(x, theta)` is the rest. `are_large` tells
    whether values are so large that doubles would round the angles; then `large=True` computes
    them modulo 2 pi, exactly (numpy only).
    """

    def __init__(
        self,
        angles: Sequence[Angle],
        inputs: Sequence[str],
        parameters: Sequence[str],
        xp: ModuleType = np,
        dtype: Any = np.float64,
    ):
        angles = [angle.moderate() for angle in angles]
        self.constant = np.array([angle.constant for angle in angles], dtype=float)
        self._inputs = _Linear(angles, inputs, xp, dtype)
        self._parameters = _Linear(angles, parameters, xp, dtype)
        self._offset = xp.asarray(self.constant, dtype=dtype) if self.constant.any() else None

    @property
    def is_constant(self) -> bool:
        return self._inputs.is_zero and self._parameters.is_zero

    @property
    def largest(self) -> tuple[float, float]:
        """Factors: a form is at most the first times max |x| plus the second times max |theta|."""
        return self._inputs.largest, self._parameters.largest

    def linear(self, x: Array, theta: Array, *, large: bool = False) -> Array:
        """The angles minus `constant`, for x (B, inputs) and theta (parameters,).

        The shape is (B, columns), or (columns,) if no angle depends on an input. Call it only if
        `is_constant` is false.

        Raises:
            CircuitError: `large`, and an angle is not finite.
        """
        if large:
            return self._reduced(x, theta)
        if self._parameters.is_zero:
            return self._inputs(x)
        if self._inputs.is_zero:
            return self._parameters(theta)
        return self._inputs(x) + self._parameters(theta)

    def _reduced(self, x: Array, theta: Array) -> Array:
        parts = ((self._inputs, x), (self._parameters, theta))
        total = sum(form.reduced(values) for form, values in parts if not form.is_zero)
        if not np.isfinite(total).all():
            raise CircuitError(
                "An angle is not finite.", "An input, a parameter or its factor is too large."
            )
        return total

    def __call__(self, x: Array, theta: Array, *, large: bool = False) -> Array:
        """The angles in radians; shapes as in `linear`."""
        if self.is_constant:
            return self.constant
        value = self.linear(x, theta, large=large)
        return value if self._offset is None else value + self._offset


def are_large(x: Array, theta: Array, largest: tuple[float, float]) -> bool:
    """Whether an angle may exceed MODERATE_RAD, or is not finite (numpy only).

    `largest` is that of the table, or the maximum of several.
    """
    (of_x, of_theta), limit = largest, MODERATE_RAD
    # The norm bounds every value, and costs less than the maximum.
    if of_x * math.sqrt(np.vdot(x, x)) + of_theta * math.sqrt(np.vdot(theta, theta)) <= limit:
        return False
    most_x, most_theta = (float(np.abs(v).max(initial=0.0)) for v in (x, theta))
    bound = of_x * most_x + of_theta * most_theta
    return not bound <= limit
