"""From the name of a backend to the executor that runs it."""

from __future__ import annotations

import numpy as np

from qcompile.device import Device, load_device
from qcompile.execution.executor import Executor
from qcompile.execution.offline import OfflineExecutor
from qcompile.execution.primitive import PrimitiveExecutor

QISKIT_PREFIX = "qiskit:"


def open_executor(
    backend: str | Device, seed: int | np.random.SeedSequence | None = None
) -> Executor:
    """The executor of a backend: a device, its name or file, or `qiskit:NAME`.

    `qiskit:FakeLimaV2` is a fake backend of qiskit-ibm-runtime, run through its sampler; anything
    else is played on the noise model of the device.

    Raises:
        DeviceError: no such device or fake backend; the message has the nearest names.
        MissingExtraError: `qiskit:NAME` without Qiskit, Aer and qiskit-ibm-runtime.
    """
    if isinstance(backend, Device):
        return OfflineExecutor(backend, seed)
    if backend.startswith(QISKIT_PREFIX):
        from qcompile.snapshot import find_backend

        return PrimitiveExecutor(find_backend(backend.removeprefix(QISKIT_PREFIX)), seed=seed)
    return OfflineExecutor(load_device(backend), seed)
