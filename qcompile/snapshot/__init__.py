"""Snapshots: the calibration of a Qiskit backend, fake or live, as a Device."""

from qcompile.snapshot.backend import (
    QISKIT_PREFIX,
    device_from_backend,
    device_name,
    find_backend,
    properties_of,
)

__all__ = ["QISKIT_PREFIX", "device_from_backend", "device_name", "find_backend", "properties_of"]
