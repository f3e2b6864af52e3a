"""From the name of a backend to the executor that runs it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from qcompile.calibration import is_calibration, load_calibration
from qcompile.device import Device, load_device
from qcompile.execution.executor import Executor
from qcompile.execution.offline import OfflineExecutor
from qcompile.execution.primitive import PrimitiveExecutor
from qcompile.execution.twin import TwinExecutor

QISKIT_PREFIX = "qiskit:"


def open_executor(
    backend: str | Device | Executor, seed: int | np.random.SeedSequence | None = None
) -> Executor:
    """The executor of a backend: a device, its name or file, a calibration file, or `qiskit:NAME`.

    An executor is given back as it is.

    A calibration file is played as the twin of its device. `qiskit:FakeLimaV2` is a fake backend of
    qiskit-ibm-runtime, run through its sampler. Anything else is played on the noise model of the
    device.

    Raises:
        CalibrationError: a calibration file with wrong contents, or without response curves.
        DeviceError: no such device or fake backend; the message has the nearest names.
        MissingExtraError: `qiskit:NAME` without Qiskit, Aer and qiskit-ibm-runtime.
    """
    if isinstance(backend, Device):
        return OfflineExecutor(backend, seed)
    if not isinstance(backend, str):
        return backend
    if backend.startswith(QISKIT_PREFIX):
        from qcompile.snapshot import find_backend

        return PrimitiveExecutor(find_backend(backend.removeprefix(QISKIT_PREFIX)), seed=seed)
    if is_calibration(Path(backend)):
        return TwinExecutor(load_calibration(Path(backend)), seed)
    return OfflineExecutor(load_device(backend), seed)


def open_device(backend: str) -> Device:
    """The device of a backend that `open_executor` opens; raises what that raises."""
    return open_executor(backend).device
