"""The record of settings: defaults, resolved values and refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from qcompile.calibration import Calibration
from qcompile.deploy.settings import RunSettings
from qcompile.device import IDEAL, load_device
from qcompile.errors import CalibrationError, CircuitError, CountsError, OptionError
from qcompile.execution import OfflineExecutor
from qcompile.mitigation import calibrate

LIMA = load_device("ibm_lima")


def calibrated(*parts: Any) -> Calibration:
    return calibrate(OfflineExecutor(LIMA, 1), np.arange(2), 1024, parts=parts)


@pytest.mark.parametrize(
    ("device", "parts", "changes", "mitigation"),
    [
        (IDEAL, None, {}, "none"),
        (LIMA, None, {}, "readout"),
        (LIMA, None, {"predistort": True}, "none"),
        (LIMA, ("readout", "response"), {}, "readout"),
        (LIMA, ("response",), {}, "response"),
        (LIMA, ("response",), {"mitigation": "none"}, "none"),
    ],
)
def test_the_default_mitigation(
    device: Any, parts: Any, changes: dict[str, Any], mitigation: str
) -> None:
    """Readout on a noisy backend, none on ideal, or the mitigation of a known calibration."""
    known = None if parts is None else calibrated(*parts)
    settings = RunSettings.of(**changes).resolved(device, known)
    assert (settings.mitigation, settings.copies, settings.shots) == (mitigation, 1, 8192)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"mitigation": "magic"}, CalibrationError, "Unknown mitigation 'magic'"),
        ({"predistort": True, "mitigation": "readout"}, OptionError, "cannot be combined"),
        ({"mitigation": "response", "level": 1}, CalibrationError, "level"),
        ({"copies": 0}, CircuitError, "copies cannot be 0"),
        ({"shots": 0}, CountsError, "0 shots"),
        ({"max_steps": 0}, CountsError, "max_steps cannot be 0"),
    ],
)
def test_contradictions(changes: dict[str, Any], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        RunSettings.of(**changes).resolved(LIMA)


@pytest.mark.parametrize(
    "changes", [{"shot": 1}, {"shots": "many"}, {"seed": -1}, {"greedy": "perhaps"}]
)
def test_wrong_names_and_values_are_told(changes: dict[str, Any]) -> None:
    (name,) = changes
    with pytest.raises(OptionError, match=name):
        RunSettings.of(**changes)


def test_a_calibration_that_nothing_reads_is_refused() -> None:
    settings = RunSettings.of(calibration=calibrated("readout"), mitigation="none")
    with pytest.raises(OptionError, match="Nothing else uses it"):
        settings.resolved(LIMA)


def test_changes_keep_the_rest() -> None:
    first = RunSettings.of(shots=16, greedy=True)
    assert RunSettings.of(first, seed=3) == RunSettings(shots=16, greedy=True, seed=3)
