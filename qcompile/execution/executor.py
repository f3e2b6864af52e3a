"""What an executor is, and the arithmetic of shots that all of them share."""

from __future__ import annotations

from typing import Literal, Protocol, runtime_checkable

import numpy as np

from qcompile.arrays import CountArray, FloatArray
from qcompile.device import Device
from qcompile.errors import CountsError, DeviceError
from qcompile.limits import MAX_SHOTS
from qcompile.passes import Executable

Kind = Literal["ideal", "noise-model", "measured-response", "hardware"]


@runtime_checkable
class Executor(Protocol):
    """Runs executables; `kind` says what the results are worth."""

    @property
    def device(self) -> Device: ...

    @property
    def kind(self) -> Kind: ...

    def run(
        self, executable: Executable, x: FloatArray, theta: FloatArray, shots: int
    ) -> CountArray:
        """The number of ones of each circuit in `shots` shots, (B, circuits), for x (B, inputs)."""
        ...

    def expectation(self, executable: Executable, x: FloatArray, theta: FloatArray) -> FloatArray:
        """The measured `<Z>` of each circuit without shot noise, (B, circuits)."""
        ...


def check_shots(shots: int) -> int:
    """`shots`, if an executor can take them.

    Raises:
        CountsError: shots lie outside [1, MAX_SHOTS].
    """
    if not 1 <= shots <= MAX_SHOTS:
        raise CountsError(
            f"{shots} shots cannot be run.",
            f"The number of shots lies in [1, {MAX_SHOTS}]; 1024 and 8192 are usual.",
            "For expectations without shot noise say `--shots exact`.",
        )
    return shots


def check_device(executable: Executable, device: Device) -> None:
    """Nothing, if an executor of `device` can run the executable.

    Raises:
        DeviceError: it was compiled for another device.
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
        CountsError: an entry lies outside [0, shots]; the message names the first one.
    """
    ones = np.asarray(ones)
    check_shots(shots)
    outside = ones.astype(np.uint64) > shots  # a negative number wraps to a huge one
    if np.count_nonzero(outside):
        raise CountsError(
            f"{ones[outside][0]} ones in {shots} shots.", f"Ones lie in [0, {shots}]."
        )
    return np.asarray(1.0 - ones * (2.0 / shots), dtype=np.float64)
