"""The base class of executors, and the arithmetic of shots that they share."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from qcompile.arrays import CountArray, FloatArray
from qcompile.calibration import Calibration
from qcompile.device import Device, Kind
from qcompile.errors import CountsError, DeviceError
from qcompile.execution.prepared import Prepared, check_shots, require_exact
from qcompile.passes import Executable


class Executor(ABC):
    """Runs executables; `kind` says what the results were measured on.

    Programs are compiled for `device`. `calibration` is the default for mitigation; None if one has
    to be measured.
    """

    device: Device
    kind: Kind
    calibration: Calibration | None = None
    _last: Prepared | None = None

    @abstractmethod
    def prepare(self, executable: Executable) -> Prepared:
        """The executable, prepared to be run repeatedly.

        Raises:
            DeviceError: the executable was compiled for another device.
        """

    def run(
        self, executable: Executable, x: FloatArray, theta: FloatArray, shots: int
    ) -> CountArray:
        """The shots with odd parity of each observable, (B, observables), for x (B, inputs).

        By default each circuit is observed: its shots with odd parity are its ones.

        Raises:
            CircuitError: x or theta has the wrong shape.
            CountsError: shots are out of range.
            DeviceError: the executable was compiled for another device.
        """
        return self._prepared(executable).ones(x, theta, check_shots(shots))

    def expectation(self, executable: Executable, x: FloatArray, theta: FloatArray) -> FloatArray:
        """The measured `<O>` of each observable without shot noise, (B, observables).

        Raises:
            CircuitError: x or theta has the wrong shape.
            CountsError: the executor needs shots.
            DeviceError: the executable was compiled for another device.
        """
        return require_exact(self._prepared(executable)).expectation(x, theta)

    def _prepared(self, executable: Executable) -> Prepared:
        """The executable, prepared; the last one is cached."""
        if self._last is None or self._last.executable is not executable:
            self._last = self.prepare(executable)
        return self._last

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.device.name})"


def check_device(executable: Executable, device: Device) -> None:
    """Check that an executor of `device` can run the executable.

    Raises:
        DeviceError: the executable was compiled for another device.
    """
    if executable.device is not device and executable.device != device:
        raise DeviceError(
            f"The executable was compiled for {executable.device.name}, "
            f"this executor runs {device.name}.",
            "Compile the program for the device it runs on, `executor.device`.",
        )


def expectation_from_ones(ones: CountArray, shots: int) -> FloatArray:
    """Return `<Z>` estimated from the number of ones.

    `ones` is an integer array of any shape, each entry in [0, shots]; the result has the same
    shape, in [-1, 1]. Its standard error is sqrt((1 - z**2) / shots).

    Raises:
        CountsError: an entry is not an integer, or lies outside [0, shots]; the message names the
            first one.
    """
    check_shots(shots)
    try:
        ones = np.asarray(ones)
    except ValueError as error:
        raise CountsError("Counts must form an array.", "Give an array of integers.") from error
    if ones.dtype.kind not in "iu" and ones.size:
        raise CountsError(f"Counts have type {ones.dtype}.", "Give integers.")
    outside = ones.astype(np.uint64) > shots  # a negative number becomes a huge one
    if np.count_nonzero(outside):
        raise CountsError(
            f"{ones[outside][0]} ones in {shots} shots.", f"Give counts from 0 to {shots}."
        )
    return np.asarray(1.0 - ones * (2.0 / shots), dtype=np.float64)
