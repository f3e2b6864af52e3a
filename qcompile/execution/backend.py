"""Backends: what an executor is opened from, in plain values that travel to other processes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from qcompile.calibration import Calibration
from qcompile.device import Device
from qcompile.execution.executor import Executor
from qcompile.execution.offline import OfflineExecutor
from qcompile.execution.primitive import PrimitiveExecutor
from qcompile.execution.twin import TwinExecutor
from qcompile.snapshot import QISKIT_PREFIX, device_from_backend, find_backend

Seed = int | np.random.SeedSequence | None


class Backend(Protocol):
    """What an executor is opened from; it can be pickled."""

    @property
    def name(self) -> str:
        """What tells it apart from other backends, those of the same device included."""
        ...

    @property
    def device(self) -> Device:
        """What programs are compiled for: the device of the executor."""
        ...

    @property
    def contents(self) -> str:
        """A text that changes with whatever the results depend on."""
        ...

    @property
    def packages(self) -> tuple[str, ...]:
        """The packages, besides numpy, whose versions the results depend on."""
        ...

    @property
    def calibration(self) -> Calibration | None:
        """What mitigates where no other calibration is given; None where one is measured."""
        ...

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        """Why it has no results with these shots (None: exact) at this level; None where it has."""
        ...

    def open(self, seed: Seed = None) -> Executor:
        """A new executor: the same seed and the same calls give the same counts."""
        ...


@dataclass(frozen=True, eq=False)
class DeviceBackend:
    """A device, played on its noise model."""

    device: Device

    packages = ()
    calibration = None

    @property
    def name(self) -> str:
        return self.device.name

    @property
    def contents(self) -> str:
        return self.device.to_json()

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        return None

    def open(self, seed: Seed = None) -> Executor:
        return OfflineExecutor(self.device, seed)


@dataclass(frozen=True, eq=False)
class TwinBackend:
    """A calibration, played as the twin of its device; `name` is that of its file.

    Raises:
        CalibrationError: the calibration holds no response curves.
    """

    name: str
    calibration: Calibration

    packages = ()

    def __post_init__(self) -> None:
        self.open()  # refuses a calibration that cannot be played

    @cached_property
    def device(self) -> Device:
        return self.open().device

    @cached_property
    def contents(self) -> str:
        return self.calibration.model_dump_json()

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        if level == 2:
            return None
        return f"level {level} on {self.name}: a twin has the response curves of level 2 alone"

    def open(self, seed: Seed = None) -> Executor:
        return TwinExecutor(self.calibration, seed)


@dataclass(frozen=True, eq=False)
class SamplerBackend:
    """A fake backend of qiskit-ibm-runtime, by the name of its class, run through its sampler."""

    fake: str

    packages = ("qiskit", "qiskit-aer", "qiskit-ibm-runtime")
    calibration = None

    @property
    def name(self) -> str:
        return f"{QISKIT_PREFIX}{self.fake}"

    @cached_property
    def device(self) -> Device:
        return device_from_backend(find_backend(self.fake))

    @cached_property
    def contents(self) -> str:
        return f"{self.name}\n{self.device.to_json()}"

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        if shots is not None:
            return None
        return f"shots exact on {self.name}: it runs through a sampler, which only has shots"

    def open(self, seed: Seed = None) -> Executor:
        return PrimitiveExecutor(find_backend(self.fake), seed=seed)


@dataclass(frozen=True, eq=False)
class ObjectBackend:
    """A Qiskit backend object, played through a SamplerV2 of the user's.

    It is named after the backend; it can be pickled where both objects can.
    """

    backend: Any
    sampler: Any

    packages = ("qiskit",)
    calibration = None

    @property
    def name(self) -> str:
        return self.device.name

    @cached_property
    def device(self) -> Device:
        return device_from_backend(self.backend)

    @cached_property
    def contents(self) -> str:
        home = type(self.sampler)
        return f"{home.__module__}.{home.__name__}\n{self.device.to_json()}"

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        if shots is not None:
            return None
        return f"shots exact on {self.name}: it runs through a sampler, which only has shots"

    def open(self, seed: Seed = None) -> Executor:
        return PrimitiveExecutor(self.backend, sampler=self.sampler, seed=seed)
