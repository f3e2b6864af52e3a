"""Backends: descriptions from which executors are opened, which can be sent to other processes."""

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
    """A picklable description from which an executor is opened."""

    @property
    def name(self) -> str:
        """A name that is unique among backends, including those of the same device."""
        ...

    @property
    def device(self) -> Device:
        """The device of the executor, for which programs are compiled."""
        ...

    @property
    def contents(self) -> str:
        """A text that changes whenever something changes that circuits of one qubit depend on."""
        ...

    @property
    def packages(self) -> tuple[str, ...]:
        """The packages besides numpy whose versions affect the results."""
        ...

    @property
    def calibration(self) -> Calibration | None:
        """The default calibration for mitigation; None if one has to be measured."""
        ...

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        """Why it cannot run with these shots (None: exact) at this level; None if it can."""
        ...

    def open(self, seed: Seed = None) -> Executor:
        """A new executor; the same seed and the same calls give the same counts."""
        ...


@dataclass(frozen=True, eq=False)
class DeviceBackend:
    """A device, simulated by its noise model."""

    device: Device

    packages = ()
    calibration = None

    @property
    def name(self) -> str:
        return self.device.name

    @property
    def contents(self) -> str:
        return self.device.without_couplings().to_json()

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        return None

    def open(self, seed: Seed = None) -> Executor:
        return OfflineExecutor(self.device, seed)


@dataclass(frozen=True, eq=False)
class TwinBackend:
    """A calibration, run as the twin of its device; `name` is that of its file.

    Raises:
        CalibrationError: the calibration has no response curves.
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
        return f"level {level} on {self.name}: a twin only supports level 2"

    def open(self, seed: Seed = None) -> Executor:
        return TwinExecutor(self.calibration, seed)


@dataclass(frozen=True, eq=False)
class SamplerBackend:
    """A fake backend of qiskit-ibm-runtime, by class name, run through its sampler."""

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
        return f"{self.name}\n{self.device.without_couplings().to_json()}"

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        if shots is not None:
            return None
        return f"shots exact on {self.name}: it runs through a sampler, which needs shots"

    def open(self, seed: Seed = None) -> Executor:
        return PrimitiveExecutor(find_backend(self.fake), seed=seed)


@dataclass(frozen=True, eq=False)
class ObjectBackend:
    """A Qiskit backend object, run through the user's SamplerV2.

    It has the name of the backend, and can be pickled if both objects can.
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
        return f"{home.__module__}.{home.__name__}\n{self.device.without_couplings().to_json()}"

    def cannot_play(self, shots: int | None, level: int) -> str | None:
        if shots is not None:
            return None
        return f"shots exact on {self.name}: it runs through a sampler, which needs shots"

    def open(self, seed: Seed = None) -> Executor:
        return PrimitiveExecutor(self.backend, sampler=self.sampler, seed=seed)
