"""Pictures of calibrations: curves of few qubits, strips of many."""

from __future__ import annotations

import csv
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from PIL import Image

import qcompile
from qcompile.calibration import Calibration
from qcompile.device import load_device
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate
from qcompile.report.calibration import draw_calibration
from qcompile.report.calibration_values import calibration_table


def measured(count: int, **options: Any) -> Calibration:
    lima = load_device("fake_lima")
    device = lima.model_copy(update={"qubits": (lima.qubits * count)[:count]})
    return calibrate(OfflineExecutor(device, 0), np.arange(count), 1000, **options)


@pytest.mark.parametrize(("count", "panels"), [(5, 5 + 2), (32, 32 + 2), (33, 3 + 2), (127, 3 + 2)])
def test_many_qubits_have_a_strip_and_not_a_curve_each(
    monkeypatch: pytest.MonkeyPatch, count: int, panels: int
) -> None:
    ticks: dict[Axes, list[str]] = {}
    draw = Axes.draw

    def note(axes: Axes, *args: Any, **options: Any) -> None:
        if axes.axison:
            ticks[axes] = [label.get_text() for label in axes.get_xticklabels()]
        draw(axes, *args, **options)

    monkeypatch.setattr(Axes, "draw", note)
    with Image.open(BytesIO(draw_calibration(measured(count)).png)) as picture:
        assert picture.width == 2100, "7 inches at 300 dots an inch"
        assert picture.height <= 3000
    assert len(ticks) == panels
    assert [*ticks.values()][-1] == [str(q) for q in range(0, count, 10 if count == 127 else 1)]


@pytest.mark.parametrize("parts", [["readout"], ["response"]])
def test_many_qubits_of_one_part(parts: Any) -> None:
    assert draw_calibration(measured(50, parts=parts)).png[:4] == b"\x89PNG"


def test_bad_fits_of_many_qubits_are_marked() -> None:
    found = measured(50)
    assert found.readout is not None
    bad = found.readout.model_copy(update={"chi_square": (1000.0,) * 50})
    marked = draw_calibration(found.model_copy(update={"readout": bad})).png
    assert marked != draw_calibration(found).png


def test_the_table_has_every_number_of_the_document() -> None:
    """Unrounded, each in a column of its own."""
    calibration = qcompile.calibrate("fake_lima", [3, 4], shots=200, seed=1, progress=False)
    values = calibration.to_dict()
    rows = [*csv.DictReader(calibration_table(values).csv().splitlines())]
    for row, qubit in zip(rows, values["qubits"], strict=True):
        expected = {
            "qubit": qubit["qubit"],
            "p10 %": 100 * qubit["p10"],
            "p10 %, error": 100 * qubit["p10_error"],
            "p01 %": 100 * qubit["p01"],
            "p01 %, error": 100 * qubit["p01_error"],
            "offset": qubit["offset"],
            "offset, error": qubit["offset_error"],
            "contrast": qubit["contrast"],
            "contrast, error": qubit["contrast_error"],
            "tilt, mrad": 1000 * qubit["tilt_rad"],
            "tilt, mrad, error": 1000 * qubit["tilt_error_rad"],
            "readout chi-square": qubit["readout_chi_square"],
            "readout expected": qubit["readout_degrees"],
            "response chi-square": qubit["response_chi_square"],
            "response expected": qubit["response_degrees"],
        }
        assert {name: float(row[name]) for name in expected} == expected
        assert {name for name in row if name not in expected} == {"readout fit", "response fit"}


def test_exact_fits_have_no_chi_square() -> None:
    calibration = qcompile.calibrate("fake_lima", [3], shots=None, seed=1, progress=False)
    (row,) = csv.DictReader(calibration_table(calibration.to_dict()).csv().splitlines())
    assert row["readout chi-square"] == row["readout expected"] == row["readout fit"] == ""
