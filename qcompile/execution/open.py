"""Opening backends: from a name, a file or an object to the executor that runs it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, overload

from qcompile.calibration import Calibration, is_calibration, load_calibration
from qcompile.device import Device, load_device
from qcompile.errors import DeviceError
from qcompile.execution.backend import (
    Backend,
    DeviceBackend,
    ObjectBackend,
    SamplerBackend,
    Seed,
    TwinBackend,
)
from qcompile.execution.executor import Executor
from qcompile.foreign import describe, is_qiskit_backend
from qcompile.snapshot import QISKIT_PREFIX, device_from_backend, find_backend


@overload
def load_backend(backend: str | Path | Device | Calibration | Backend) -> Backend: ...
@overload
def load_backend(backend: Executor) -> Executor: ...
@overload
def load_backend(backend: Any, *, sampler: Any = None) -> Backend: ...


def load_backend(backend: Any, *, sampler: Any = None) -> Any:
    """The backend with a name, from a file, or for an object.

    A name or a path is that of a device or its file; of a calibration file, which is run as the
    twin of its device; or `qiskit:FakeLimaV2`, a fake backend of qiskit-ibm-runtime that is run
    through its sampler. A Device is run on its noise model, a Calibration as a twin. The
    calibration of a Qiskit BackendV2 is read now and run as a noise model, in arrays; with
    `sampler`, a SamplerV2, circuits run through that sampler instead, and `sampler_kind` is the
    kind of its counts. A backend or an executor is returned unchanged.

    Raises:
        CalibrationError: the calibration is invalid, or has no response curves.
        DeviceError: there is no such device or fake backend (the message suggests similar names),
            a Qiskit backend cannot be turned into a device, or a sampler has no backend.
        MissingExtraError: `qiskit:NAME` without qiskit-ibm-runtime.
    """
    if is_qiskit_backend(backend):
        if sampler is not None:
            return ObjectBackend(backend, sampler)
        return DeviceBackend(device_from_backend(backend))
    if sampler is not None:
        raise DeviceError(
            f"sampler= needs the Qiskit backend it runs on, found {describe(backend)}.",
            "Use load_backend(backend, sampler=sampler) with a BackendV2.",
        )
    if isinstance(backend, str | Path):
        return _named(str(backend))
    if isinstance(backend, Device):
        return DeviceBackend(backend)
    if isinstance(backend, Calibration):
        return TwinBackend(f"twin of {backend.device.name}", backend)
    if isinstance(backend, Executor) or (hasattr(backend, "open") and hasattr(backend, "device")):
        return backend
    raise DeviceError(
        f"load_backend cannot take {describe(backend)}.",
        "It takes a name, a file, a Device, a Calibration, an executor or a Qiskit BackendV2.",
    )


def _named(name: str) -> Backend:
    if name.startswith(QISKIT_PREFIX):
        return SamplerBackend(type(find_backend(name)).__name__)
    path = Path(name)
    if is_calibration(path):
        return TwinBackend(str(path), load_calibration(path))
    return DeviceBackend(load_device(name))


def open_executor(backend: Any, seed: Seed = None) -> Executor:
    """The executor of anything that `load_backend` takes; an executor is returned unchanged.

    Raises:
        CalibrationError, DeviceError: as in `load_backend`.
        MissingExtraError: `qiskit:NAME` without Qiskit, Aer and qiskit-ibm-runtime.
    """
    backend = load_backend(backend)
    executor: Executor = backend if isinstance(backend, Executor) else backend.open(seed)
    return executor


def open_device(backend: str) -> Device:
    """The device of the backend that `load_backend` finds, with the same errors."""
    return load_backend(backend).device
