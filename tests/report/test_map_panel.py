"""The qubits of a device in a film, found by their colours."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.device import load_device
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable
from qcompile.report.map_panel import MapPanel
from qcompile.report.panels import GROUND, MEASURED, Box
from qcompile.report.positions import positions_of

BOX = Box(20, 10, 600, 176)


def placed(name: str, qubits: list[int], gates: str) -> Executable:
    circuit = Circuit.parse(gates, len(qubits))
    program = Program((circuit,))
    return Executable(program, program, load_device(name), 2, np.array(qubits), np.array([0]))


def drawn(executable: Executable) -> np.ndarray:
    picture = np.full((200, 640, 3), GROUND, dtype=np.uint8)
    MapPanel(BOX, executable).prepare(picture)
    return picture


def blue(picture: np.ndarray) -> np.ndarray:
    return (picture[38:] == MEASURED).all(axis=2)


@pytest.mark.parametrize("name", ["fake_lima", "fake_jakarta"])
def test_a_small_device_is_shown_whole(name: str) -> None:
    """Where its qubits are, there is something on the ground; where some are used, it is blue."""
    executable = placed(name, [0, 1], "cx@0,1")
    panel = MapPanel(BOX, executable)
    places = positions_of(executable.device)
    shown = panel._places
    np.testing.assert_allclose(shown - shown[0], (places - places[0]) * panel._step)
    assert panel._step >= 32
    picture = drawn(executable)
    for qubit, (x, y) in enumerate(shown.tolist()):
        column, row = round(BOX.x + x), round(BOX.y + 28 + y)
        edge = round(0.24 * panel._step)
        beside = picture[row, column - edge]
        assert (beside == MEASURED).all() == (qubit in (0, 1))


def test_of_a_large_device_the_neighbourhood_is_shown() -> None:
    panel = MapPanel(BOX, placed("fake_fez", [142, 143], "cz@0,1"))
    x, y = panel._places.T
    inside = (x > 0) & (x < 600) & (y > 0) & (y < 148)
    assert {140, 142, 143, 144} <= set(np.flatnonzero(inside).tolist())
    assert 0 not in np.flatnonzero(inside)
    assert panel._step >= 32, "numbers of three digits have room"


def test_more_is_blue_where_more_is_used() -> None:
    few, many = (
        blue(drawn(placed("fake_lima", qubits, gates))).sum()
        for qubits, gates in (([0, 1], "cx@0,1"), ([0, 1, 2], "cx@0,1 cx@1,2"))
    )
    assert many > 1.3 * few > 0


@pytest.mark.parametrize(
    ("name", "qubits"), [("fake_fez", [0, 155]), ("fake_toronto", [9, 17]), ("fake_lima", [4, 0])]
)
def test_nothing_is_drawn_beyond_its_box(name: str, qubits: list[int]) -> None:
    picture = drawn(placed(name, qubits, ""))
    assert blue(picture).any()
    for rim in (picture[:10], picture[186:], picture[:, :20], picture[:, 620:]):
        assert (rim == GROUND).all()
