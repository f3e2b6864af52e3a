"""Choose a physical qubit and a round for every circuit."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray, IntArray, real_array
from qcompile.device import Device
from qcompile.errors import CircuitError
from qcompile.ir import Program
from qcompile.limits import MAX_EPISODES
from qcompile.noise import usable
from qcompile.passes.place_wide import wide_copies_that_fit


def copies_that_fit(program: Program, device: Device) -> int:
    """How many copies of a program fit on the usable qubits at once, at least one.

    Circuits of several qubits are routed to find out (`passes.place_wide`).

    Raises:
        DeviceError, MissingExtraError: circuits of several qubits cannot be routed.
    """
    if program.is_wide:
        return wide_copies_that_fit(program, device)
    return max(len(usable(device)) // max(len(program), 1), 1)


def place(
    circuits: int, device: Device, importance: FloatArray | None = None, copies: int = 1
) -> tuple[IntArray, IntArray]:
    """Physical qubit and round of each circuit, two (copies * circuits,) arrays, copy by copy.

    `importance` (circuits,) is the cost of a squared error of a circuit's `<Z>`; by default it is
    the same for all. The placement has the least cost, the sum over circuits of importance times
    `mean_square_error` of the qubit, among those with the fewest rounds that hold every circuit on
    `usable` qubits (`qcompile.noise`): in a round each qubit has one place. The ideal device has a
    qubit for each circuit.

    Because the cost is a product, no solver for the assignment problem is needed: by the
    rearrangement inequality the most important circuits get the best places, and the worst stay
    empty. For this, every circuit is assumed to have the pulses of sx rz sx: a pulse more or less
    matters far less than the readout error.

    Ties are broken by index, so a placement repeats exactly. Copies tie, and take turns in going
    first, so that all get equally good qubits.

    Raises:
        CircuitError: `importance` is not one finite number >= 0 for each circuit, or copies < 1.
    """
    importance = checked_importance(circuits, importance, copies)
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


def circuit_importance(
    program: Program, importance: FloatArray | None = None, copies: int = 1
) -> FloatArray:
    """The importance of each circuit, (circuits,): the sum over its observables.

    `importance` (observables,) is theirs; by default it is the same for all.

    Raises:
        CircuitError: as `place`.
    """
    of_observables = checked_importance(len(program.measured), importance, copies)
    if not program.has_products:
        return of_observables
    return np.asarray(np.bincount(program.owners, of_observables, len(program)), dtype=float)


def checked_importance(circuits: int, importance: FloatArray | None, copies: int) -> FloatArray:
    """`importance` as (circuits,) numbers, all equal by default.

    Raises:
        CircuitError: it is not one finite number >= 0 for each circuit, or copies are out of range.
    """
    if not isinstance(copies, int | np.integer) or not 1 <= copies <= MAX_EPISODES:
        raise CircuitError(
            f"{copies!s:.60} copies of a program cannot be placed.",
            f"The number of copies is 1 to {MAX_EPISODES}.",
        )
    importance = real_array(np.ones(circuits) if importance is None else importance)
    if importance is None:
        raise CircuitError(
            "The importance of circuits is not an array of real numbers.",
            f"It needs shape ({circuits},) and finite entries, none negative.",
        )
    if importance.shape != (circuits,) or not (np.isfinite(importance) & (importance >= 0)).all():
        raise CircuitError(
            f"The importance of circuits has shape {importance.shape}, or invalid entries.",
            f"It needs shape ({circuits},) and finite entries, none negative.",
        )
    return importance
