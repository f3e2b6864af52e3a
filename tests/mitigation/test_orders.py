"""Each qubit gets all angles, in an order that reveals its neighbours."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.mitigation.measure import LIVE_ANGLES_RAD, RESPONSE_ANGLES_RAD
from qcompile.mitigation.orders import ORDERS, angle_orders, mismatch


@pytest.mark.parametrize("angles", [LIVE_ANGLES_RAD, RESPONSE_ANGLES_RAD, np.arange(3.0)])
def test_every_qubit_sees_every_angle(angles: np.ndarray) -> None:
    orders = angle_orders(angles, np.arange(200))
    assert orders.shape == (len(angles), 200)
    np.testing.assert_array_equal(np.sort(orders, axis=0), np.sort(angles)[:, None].repeat(200, 1))


def test_the_order_depends_on_the_index_of_the_qubit() -> None:
    every = angle_orders(LIVE_ANGLES_RAD, np.arange(200))
    np.testing.assert_array_equal(angle_orders(LIVE_ANGLES_RAD, np.array([150, 3])),
                                  every[:, [150, 3]])  # fmt: skip
    assert len(np.unique(every, axis=1).T) == ORDERS


@pytest.mark.parametrize(("angles", "least"), [(LIVE_ANGLES_RAD, 0.49), (RESPONSE_ANGLES_RAD, 1)])
def test_any_two_qubits_show_in_each_other(angles: np.ndarray, least: float) -> None:
    """By least squares: what no curve of qubit i explains of the <Z> of qubit j, in one shot."""
    orders = angle_orders(angles, np.arange(ORDERS)).T
    found = mismatch(orders)
    others = found[~np.eye(ORDERS, dtype=bool)]
    assert others.min() > least
    np.testing.assert_allclose(found.diagonal(), 0, atol=1e-9)
    for i, j in ((0, 1), (5, 60), (33, 2)):
        root = 1 / np.sqrt(1 - (0.95 * np.cos(orders[i])) ** 2)
        design = np.stack([np.ones_like(root), np.cos(orders[i]), np.sin(orders[i])], axis=1)
        _, residual, *_ = np.linalg.lstsq(design * root[:, None], np.cos(orders[j]) * root)
        assert found[i, j] == pytest.approx(residual[0], rel=1e-9)
