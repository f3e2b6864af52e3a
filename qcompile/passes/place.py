"""Choose a physical qubit and a round for every circuit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qcompile.device import Device

IntArray = NDArray[np.intp]


def place(circuits: int, device: Device) -> tuple[IntArray, IntArray]:
    """Physical qubit and round of each circuit, two (circuits,) arrays.

    Circuits fill `device.usable`, the best readout first; what does not fit goes to a next round.
    The ideal device has a qubit for each circuit.
    """
    index = np.arange(circuits)
    if device.is_ideal:
        return index, np.zeros_like(index)
    usable = np.array(device.usable)
    return usable[index % len(usable)], index // len(usable)
