"""The order in which each qubit gets the angles of a calibration, chosen to reveal crosstalk.

If all qubits had the same angle, a bit that depends on its neighbour would still lie on a curve.
With different orders it does not, which shows in the chi-square of the fit.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import islice, permutations

import numpy as np

from qcompile.arrays import FloatArray, IntArray

ORDERS = 64
"""The number of orders. Qubits whose indices differ by a multiple of it share an order."""
_CANDIDATES = 720
_USUAL_CONTRAST = 0.95


def angle_orders(angles_rad: FloatArray, qubits: IntArray) -> FloatArray:
    """The angle of each of `qubits` in each circuit, (angles, qubits): each qubit gets every angle.

    The order depends only on the index of the qubit, not on the other qubits measured.
    """
    orders = np.array(_orders(tuple(angles_rad.tolist())))
    return np.ascontiguousarray(orders[np.asarray(qubits) % len(orders)].T)


def mismatch(orders: FloatArray) -> FloatArray:
    """How badly `<Z>` of a qubit with order j fits a curve of one with order i, (orders, orders).

    `orders` is (orders, angles). The result is the chi-square of one shot, with the shot noise of a
    typical qubit. A bit that copies a fraction e of its neighbour adds shots e^2 times that.
    """
    root = 1.0 / np.sqrt(1.0 - (_USUAL_CONTRAST * np.cos(orders)) ** 2)
    design = np.stack([np.ones_like(orders), np.cos(orders), np.sin(orders)], axis=-1)
    basis, _ = np.linalg.qr(design * root[..., None])
    signal = root[:, None] * np.cos(orders)
    return np.asarray((signal**2).sum(axis=-1) - ((signal @ basis) ** 2).sum(axis=-1))


@lru_cache(maxsize=8)
def _orders(angles_rad: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    """Up to ORDERS orders, each the most different from those before it (farthest point first)."""
    few = list(islice(permutations(angles_rad), _CANDIDATES + 1))
    if len(few) > _CANDIDATES:
        rng = np.random.default_rng(0)
        few = [angles_rad, *(tuple(rng.permutation(angles_rad)) for _ in range(_CANDIDATES // 2))]
    candidates = np.array(few)
    between = mismatch(candidates)
    between = np.minimum(between, between.T)
    chosen, least = [0], between[0].copy()
    while len(chosen) < min(ORDERS, len(candidates)):
        chosen.append(int(least.argmax()))
        least = np.minimum(least, between[chosen[-1]])
    return tuple(map(tuple, candidates[chosen].tolist()))
