"""Where a map draws the qubits of a device."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.device import Device, load_device
from qcompile.report.positions import positions_of


def device(qubits: int, *pairs: tuple[int, int]) -> Device:
    """A device without positions; its couplings are all alike."""
    lima = load_device("fake_lima")
    coupling = lima.couplings[0]
    return Device(
        format="qcompile-device-2",
        name="d",
        source="test",
        basis_gates=lima.basis_gates,
        qubits=lima.qubits[:1] * qubits,
        couplings=tuple(coupling.model_copy(update={"qubits": pair}) for pair in pairs),
    )


def lengths(found: Device) -> np.ndarray:
    places = positions_of(found)
    ends = np.array([coupling.qubits for coupling in found.couplings])
    return np.linalg.norm(places[ends[:, 0]] - places[ends[:, 1]], axis=1)


@pytest.mark.parametrize("name", ["fake_lagos", "fake_fez", "fake_kingston"])
def test_a_device_says_where_its_qubits_are(name: str) -> None:
    found = load_device(name)
    places = np.array(found.positions)
    np.testing.assert_array_equal(positions_of(found), places - places.min(axis=0))
    np.testing.assert_array_equal(lengths(found), 1.0)


LINE, RING = (
    device(5, *((i, i + 1) for i in range(4))),
    device(6, *((i, (i + 1) % 6) for i in range(6))),
)


@pytest.mark.parametrize(
    "found", [load_device("fake_lima"), load_device("fake_toronto"), LINE, RING, device(2, (1, 0))]
)
def test_couplings_of_others_are_about_equally_long(found: Device) -> None:
    assert np.abs(lengths(found) - 1).max() < 0.1


def test_a_line_lies_from_left_to_right() -> None:
    places = positions_of(LINE)
    np.testing.assert_allclose(places[:, 0], np.arange(5), atol=0.05)
    assert np.ptp(places[:, 1]) < 0.1


def test_a_hexagon_is_one() -> None:
    places = positions_of(RING)
    radii = np.linalg.norm(places - places.mean(axis=0), axis=1)
    np.testing.assert_allclose(radii, 1.0, atol=0.02)


@pytest.mark.parametrize(
    "found", [device(1), device(4), device(5, (0, 1)), device(7, (0, 1), (1, 2), (4, 5))]
)
def test_qubits_without_couplings_have_places_of_their_own(found: Device) -> None:
    places = positions_of(found)
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert np.isfinite(places).all()
    assert (apart[~np.eye(len(places), dtype=bool)] > 0.5).all()
