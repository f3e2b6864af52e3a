"""From the name of a backend to what runs on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from qcompile.calibration import is_calibration, load_calibration
from qcompile.device import Device, load_device
from qcompile.execution.executor import Executor
from qcompile.execution.offline import OfflineExecutor
from qcompile.execution.twin import TwinExecutor


def open_executor(backend: str | Device, seed: int | np.random.SeedSequence | None) -> Executor:
    """The executor of a device, of a device's name or file, or of a calibration file (its twin).

    Raises:
        CalibrationError: a calibration file with wrong contents, or without response curves.
        DeviceError: no such device.
    """
    if isinstance(backend, Device):
        return OfflineExecutor(backend, seed)
    if is_calibration(Path(backend)):
        return TwinExecutor(load_calibration(Path(backend)), seed)
    return OfflineExecutor(load_device(backend), seed)
