"""The order in which each qubit sees the angles of a calibration, so that neighbours show.

Were all qubits turned by the same angle, a bit read in part from its neighbour would lie on a curve
all the same. With orders that differ it does not, and the chi-square of the fit tells.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import islice, permutations

import numpy as np

from qcompile.arrays import FloatArray, IntArray

ORDERS = 64
"""Qubits whose numbers differ by a multiple of this share an order; neighbours never do."""
_CANDIDATES = 720
_USUAL_CONTRAST = 0.95


def angle_orders(angles_rad: FloatArray, qubits: IntArray) -> FloatArray:
    """The angle of each of `qubits` in each circuit, (angles, qubits): every qubit sees every one.

    A qubit has its order by its number, whatever is measured beside it.
    """
    orders = np.array(_orders(tuple(angles_rad.tolist())))
    return np.ascontiguousarray(orders[np.asarray(qubits) % len(orders)].T)


def mismatch(orders: FloatArray) -> FloatArray:
    """How badly `<Z>` of a qubit with order j fits a curve of one with order i, (orders, orders).

    `orders` is (orders, angles). It is the chi-square of one shot, by the shot noise of a usual
    qubit: a bit that copies a share e of its neighbour's adds shots e^2 times as much.
    """
    root = 1.0 / np.sqrt(1.0 - (_USUAL_CONTRAST * np.cos(orders)) ** 2)
    design = np.stack([np.ones_like(orders), np.cos(orders), np.sin(orders)], axis=-1)
    basis, _ = np.linalg.qr(design * root[..., None])
    signal = root[:, None] * np.cos(orders)
    return np.asarray((signal**2).sum(axis=-1) - ((signal @ basis) ** 2).sum(axis=-1))


@lru_cache(maxsize=8)
def _orders(angles_rad: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    """Up to ORDERS orders, each the one least like those before it (farthest point first)."""
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
