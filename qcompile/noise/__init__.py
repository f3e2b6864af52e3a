"""The noise of devices as affine maps of the Bloch vector."""

from qcompile.noise.circuits import NoisyCircuits, noise_after, readout_row, rotation_map

__all__ = ["NoisyCircuits", "noise_after", "readout_row", "rotation_map"]
