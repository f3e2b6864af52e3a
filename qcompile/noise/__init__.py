"""The noise of devices as affine maps of the Bloch vector."""

from qcompile.noise.circuits import NoisyCircuits

__all__ = ["NoisyCircuits"]
