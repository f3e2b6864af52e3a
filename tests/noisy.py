"""The circuits of an executable with the noise of its device."""

from __future__ import annotations

from qcompile.noise import NoisyCircuits
from qcompile.passes import Executable


def noisy_circuits(executable: Executable) -> NoisyCircuits:
    return NoisyCircuits(executable.native.circuits, executable.device, executable.qubits)
