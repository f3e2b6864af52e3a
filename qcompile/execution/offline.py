"""The executor that needs no machine: a device's noise model, exact, and binomial shots."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from qcompile.arrays import CountArray, FloatArray
from qcompile.device import Device
from qcompile.execution.executor import Kind, check_device, check_shots
from qcompile.noise import NoisyCircuits
from qcompile.passes import Executable


class OfflineExecutor:
    """Runs executables on the noise model of `device`.

    Circuits are not entangled, so the ones of each circuit in N shots are one binomial draw.
    The same seed and the same calls give the same counts.
    """

    def __init__(self, device: Device, seed: int | np.random.SeedSequence | None = None):
        self.device = device
        self.kind: Kind = "ideal" if device.is_ideal else "noise-model"
        self.rng = np.random.default_rng(seed)
        self._noisy: WeakKeyDictionary[Executable, NoisyCircuits] = WeakKeyDictionary()

    def run(
        self, executable: Executable, x: FloatArray, theta: FloatArray, shots: int
    ) -> CountArray:
        """The number of ones of each circuit in `shots` shots, (B, circuits) integers.

        Raises:
            CountsError: shots out of range.
            DeviceError: the executable was compiled for another device.
        """
        check_shots(shots)
        p_one = self._p_one(executable, x, theta)
        return self.rng.binomial(shots, np.minimum(np.maximum(p_one, 0.0), 1.0))

    def expectation(self, executable: Executable, x: FloatArray, theta: FloatArray) -> FloatArray:
        """The measured `<Z>` of each circuit without shot noise, (B, circuits), readout included.

        Raises:
            DeviceError: the executable was compiled for another device.
        """
        return 1.0 - 2.0 * self._p_one(executable, x, theta)

    def _p_one(self, executable: Executable, x: FloatArray, theta: FloatArray) -> FloatArray:
        noisy = self._noisy.get(executable)
        if noisy is None:
            check_device(executable, self.device)
            noisy = self._noisy[executable] = NoisyCircuits(executable)
        return noisy.p_one(*executable.bind_turns(x, theta))
