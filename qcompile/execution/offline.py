"""The offline executor: the exact noise model of a device, and binomial shots."""

from __future__ import annotations

from typing import Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.device import Device, Kind
from qcompile.errors import DeviceError, OptionError
from qcompile.execution.executor import Executor, check_device
from qcompile.execution.prepared import ExactPrepared
from qcompile.execution.wide import PreparedWide
from qcompile.foreign import describe
from qcompile.noise import NoisyCircuits
from qcompile.passes import Executable


class OfflineExecutor(Executor):
    """Runs executables on the noise model of `device`, readout included.

    Circuits are not entangled with each other: the ones of a circuit of one qubit in N shots are
    one binomial draw, the outcomes of a wider one a multinomial draw.
    The same seed and the same calls give the same counts. `dtype`, float32 or float64, is that of
    the states of wider circuits up to 8 qubits.

    Raises:
        DeviceError: `device` is not a Device.
        OptionError: there is no such `dtype`.
    """

    def __init__(
        self,
        device: Device,
        seed: int | np.random.SeedSequence | None = None,
        dtype: type[np.floating[Any]] = np.float64,
    ):
        if not isinstance(device, Device):
            raise DeviceError(
                f"OfflineExecutor takes a Device, found {describe(device)}.",
                "Use load_backend(name_or_object).device.",
            )
        if dtype not in (np.float32, np.float64):
            raise OptionError(f"dtype cannot be {dtype!r}.", "Use numpy.float64 or numpy.float32.")
        self.device, self._dtype = device, np.dtype(dtype)
        self.kind: Kind = "ideal" if device.is_ideal else "noise-model"
        self.rng = np.random.default_rng(seed)

    def prepare(self, executable: Executable) -> ExactPrepared:
        """The executable with the noise of its qubits.

        Raises:
            DeviceError: the executable was compiled for another device.
        """
        check_device(executable, self.device)
        if executable.source.has_products:
            return PreparedWide(executable, self.rng, self._dtype)
        return _PreparedNoise(executable, self.rng)


class _PreparedNoise(ExactPrepared):
    def __init__(self, executable: Executable, rng: np.random.Generator):
        super().__init__(executable, rng)
        self._noisy = NoisyCircuits(
            executable.native.circuits, executable.device, executable.qubits
        )

    def p_one(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        return self._noisy.p_one(*self.executable.bind_turns(x, theta))
