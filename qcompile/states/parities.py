"""Sums over outcomes with the signs of products of Z."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def signed_sums(values: NDArray[Any]) -> NDArray[Any]:
    """For each product of Z, the sum of values (..., 2**width) with the signs of their outcomes.

    This is the Walsh-Hadamard transform, and its own inverse times 2**width.
    """
    shape, size = values.shape, values.shape[-1]
    half = 1
    while half < size:
        even, odd = np.moveaxis(values.reshape(*shape[:-1], -1, 2, half), -2, 0)
        values = np.stack([even + odd, even - odd], axis=-2)
        half *= 2
    return values.reshape(shape)
