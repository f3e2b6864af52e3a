"""Aliases for array types, and a check for real numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]
CountArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.intp]
CircuitShots = int | CountArray
"""Shots: one number for every circuit, or (circuits,) with one for each."""


def real_array(values: Any) -> FloatArray | None:
    """`values` as an array of doubles; None unless all are real numbers and none is masked."""
    try:
        array = np.asarray(values)
    except (ValueError, TypeError):  # a ragged list
        return None
    if array.dtype.kind not in "biuf" or hasattr(values, "mask"):
        return None
    return np.asarray(array, dtype=np.float64)
