"""The noise of devices: channels, the quality of qubits, and noisy circuits."""

from qcompile.noise.channels import Channel, channel_after
from qcompile.noise.circuits import NoisyCircuits, noise_after, readout_row, rotation_map
from qcompile.noise.quality import (
    REFERENCE_SHOTS,
    USABLE_CONTRAST,
    expected_error,
    mean_square_error,
    unusable,
    usable,
)

__all__ = [
    "REFERENCE_SHOTS",
    "USABLE_CONTRAST",
    "Channel",
    "NoisyCircuits",
    "channel_after",
    "expected_error",
    "mean_square_error",
    "noise_after",
    "readout_row",
    "rotation_map",
    "unusable",
    "usable",
]
