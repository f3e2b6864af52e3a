"""Calibrations made by hand, and devices whose only error is the readout."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from qcompile.calibration import Calibration, ReadoutFit, ResponseFit
from qcompile.device import Device, Qubit, load_device


def noiseless_gates(name: str) -> Device:
    """The device with its own readout and perfect gates: its only error is assignment."""
    device = load_device(name)
    qubits = tuple(qubit.model_copy(update={"gates": {}}) for qubit in device.qubits)
    return device.model_copy(update={"qubits": qubits})


def blank(count: int, basis_gates: tuple[str, ...]) -> Device:
    qubit = Qubit(t1_us=100, t2_us=100, p10=0.0, p01=0.0)
    return Device(
        name="blank", source="by hand", basis_gates=basis_gates, qubits=(qubit,) * count
    )  # fmt: skip


def calibration(
    *,
    readout: tuple[list[float], list[float]] | None = None,
    curves: list[list[float]] | None = None,
    error: float = 0.0,
    basis_gates: tuple[str, ...] = ("rz", "sx", "x"),
    **fields: Any,
) -> Calibration:
    """Of readout errors (p10, p01) or curves of all qubits, each known to +-`error`."""
    count = len(readout[0] if readout else curves)  # type: ignore[arg-type]
    none = (0.0,) * count
    device = fields.pop("device", blank(count, basis_gates))
    return Calibration(
        **{
            "backend": device.name,
            "kind": "noise-model",
            "created": datetime(2026, 1, 2, tzinfo=UTC),
            "device": device,
            "qubits": tuple(range(count)),
            "readout": readout
            and ReadoutFit(
                p10=tuple(readout[0]),
                p01=tuple(readout[1]),
                p10_error=(error,) * count,
                p01_error=(error,) * count,
                chi_square=none,
                degrees_of_freedom=0,
            ),
            "response": curves
            and ResponseFit(
                curves=tuple(map(tuple, curves)),  # type: ignore[arg-type]
                covariance=tuple([tuple(map(tuple, error**2 * np.eye(3)))] * count),
                chi_square=none,
                degrees_of_freedom=5,
            ),
            **fields,
        }
    )


@pytest.fixture(name="noiseless_gates")
def _noiseless_gates() -> Callable[[str], Device]:
    return noiseless_gates


@pytest.fixture
def made() -> Callable[..., Calibration]:
    return calibration
