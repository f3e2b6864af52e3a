"""Names for the types of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]
CountArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
CircuitShots = int | CountArray
"""Shots: of every circuit, or of each, (circuits,)."""


def real_array(values: Any) -> FloatArray | None:
    """`values` as an array of doubles; None where they are no real numbers, or some are masked."""
    try:
        array = np.asarray(values)
    except (ValueError, TypeError):  # a ragged list
        return None
    if array.dtype.kind not in "biuf" or hasattr(values, "mask"):
        return None
    return np.asarray(array, dtype=np.float64)
