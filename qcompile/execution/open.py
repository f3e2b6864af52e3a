"""From the name of a backend to the executor that runs it."""

from __future__ import annotations

from pathlib import Path

from qcompile.calibration import is_calibration, load_calibration
from qcompile.device import Device, load_device
from qcompile.execution.backend import (
    QISKIT_PREFIX,
    Backend,
    DeviceBackend,
    SamplerBackend,
    Seed,
    TwinBackend,
)
from qcompile.execution.executor import Executor


def load_backend(name: str) -> Backend:
    """The backend of a name: that of a device, its file, a calibration file, or `qiskit:NAME`.

    A calibration file is played as the twin of its device. `qiskit:FakeLimaV2` is a fake backend of
    qiskit-ibm-runtime, run through its sampler. Anything else is played on the noise model of the
    device.

    Raises:
        CalibrationError: a calibration file with wrong contents, or without response curves.
        DeviceError: no such device or fake backend; the message has the nearest names.
        MissingExtraError: `qiskit:NAME` without qiskit-ibm-runtime.
    """
    if name.startswith(QISKIT_PREFIX):
        from qcompile.snapshot import find_backend

        return SamplerBackend(type(find_backend(name.removeprefix(QISKIT_PREFIX))).__name__)
    path = Path(name)
    if is_calibration(path):
        return TwinBackend(str(path), load_calibration(path))
    return DeviceBackend(load_device(name))


def open_executor(backend: str | Device | Backend | Executor, seed: Seed = None) -> Executor:
    """The executor of a backend, of one that `load_backend` finds, or of a device's noise model.

    An executor is given back as it is.

    Raises:
        CalibrationError, DeviceError: what `load_backend` raises.
        MissingExtraError: `qiskit:NAME` without Qiskit, Aer and qiskit-ibm-runtime.
    """
    if isinstance(backend, str):
        backend = load_backend(backend)
    elif isinstance(backend, Device):
        backend = DeviceBackend(backend)
    return backend if isinstance(backend, Executor) else backend.open(seed)


def open_device(backend: str) -> Device:
    """The device of a backend that `load_backend` finds; raises what that raises."""
    return load_backend(backend).device
