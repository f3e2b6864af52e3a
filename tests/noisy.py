"""Noise for tests: circuits with that of their device, and qubits whose neighbours are read too."""

from __future__ import annotations

import numpy as np

from qcompile.device import Device
from qcompile.execution import ExactPrepared, Executor, OfflineExecutor
from qcompile.noise import NoisyCircuits
from qcompile.passes import Executable


def noisy_circuits(executable: Executable) -> NoisyCircuits:
    """The circuits of an executable with the noise of its device."""
    return NoisyCircuits(executable.native.circuits, executable.device, executable.qubits)


class Neighbours(Executor):
    """Each bit is, with a probability `share`, that of the qubit q ^ 1, if that is measured too."""

    kind = "noise-model"

    def __init__(self, device: Device, share: float, seed: int):
        self.device, self.share, self.rng = device, share, np.random.default_rng(seed)

    def prepare(self, executable: Executable) -> ExactPrepared:
        return Beside(executable, self.share, self.rng)


class Beside(ExactPrepared):
    """The circuits of an executable, and which circuit is beside each."""

    def __init__(self, executable: Executable, share: float, rng: np.random.Generator):
        super().__init__(executable, rng)
        self._alone = OfflineExecutor(executable.device).prepare(executable)
        places = list(zip(executable.qubits.tolist(), executable.rounds.tolist(), strict=True))
        at = {place: index for index, place in enumerate(places)}
        self._beside = np.array([at.get((q ^ 1, r), at[q, r]) for q, r in places])
        self._share = share

    def p_one(self, x: np.ndarray, theta: np.ndarray) -> np.ndarray:
        p_one = self._alone.p_one(x, theta)
        return (1 - self._share) * p_one + self._share * p_one[:, self._beside]
