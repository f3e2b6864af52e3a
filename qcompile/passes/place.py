"""Choose a physical qubit and a round for every circuit."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray, IntArray, real_array
from qcompile.device import Device
from qcompile.errors import CircuitError
from qcompile.limits import MAX_EPISODES
from qcompile.noise import usable


def copies_that_fit(circuits: int, device: Device) -> int:
    """How many copies of `circuits` fit side by side on the usable qubits; one at least."""
    return max(len(usable(device)) // max(circuits, 1), 1)


def place(
    circuits: int, device: Device, importance: FloatArray | None = None, copies: int = 1
) -> tuple[IntArray, IntArray]:
    """Physical qubit and round of each circuit, two (copies * circuits,) arrays, copy by copy.

    `importance` (circuits,) is what a square error of a circuit's `<Z>` costs; left out, it is the
    same for all. The placement is the one of the least cost, the sum over circuits of importance
    times `mean_square_error` of the qubit, among those of the fewest rounds that hold every circuit
    on `usable` qubits (`qcompile.noise`): a round has one place on each qubit. The ideal device has
    a qubit for each circuit.

    A cost that is a product needs no solver for the assignment problem: by the rearrangement
    inequality the most important circuits get the best places, and the worst stay empty. To this
    end the pulses of every circuit count as those of sx rz sx: that the circuits of a program
    differ by a pulse matters far less than what they are read with.

    Ties go by index, so a placement repeats exactly. Copies tie: they take turns at who comes
    first, so that all get equally good qubits.

    Raises:
        CircuitError: `importance` is not one finite number >= 0 for each circuit, or copies < 1.
    """
    if not isinstance(copies, int | np.integer) or not 1 <= copies <= MAX_EPISODES:
        raise CircuitError(
            f"{copies!s:.60} copies of a program cannot be placed.",
            f"One is the least, and {MAX_EPISODES} are the most.",
        )
    importance = real_array(np.ones(circuits) if importance is None else importance)
    if importance is None:
        raise CircuitError(
            "The importance of circuits is not real numbers.",
            f"It needs ({circuits},), each a finite number that is not negative.",
        )
    if importance.shape != (circuits,) or not (np.isfinite(importance) & (importance >= 0)).all():
        raise CircuitError(
            f"The importance of circuits has shape {importance.shape} or wrong entries.",
            f"It needs ({circuits},), each a finite number that is not negative.",
        )
    index = np.arange(copies * circuits)
    if device.is_ideal:
        return index, np.zeros_like(index)
    places = np.array(usable(device))
    round_count = -(-len(index) // len(places)) or 1
    order = np.argsort(-importance, kind="stable")[:, None] + circuits * np.arange(copies)
    order[1::2] = order[1::2, ::-1]
    qubits, rounds = np.empty_like(index), np.empty_like(index)
    qubits[order.ravel()] = places[index // round_count]
    rounds[order.ravel()] = index % round_count
    return qubits, rounds
