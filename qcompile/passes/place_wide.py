"""Choose qubits and rounds for programs with circuits of several qubits."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.device import Device
from qcompile.errors import CircuitError
from qcompile.ir import Circuit, Program
from qcompile.noise import usable
from qcompile.passes.drop_unobservable import DropIdleCouplings
from qcompile.passes.route import route

_WORSE, _SMALL = 2.0, 0.05
"""The largest ratio of the coupling errors of a copy and the first one, and errors always taken."""


class Placed(NamedTuple):
    """A program on a device's couplings, the qubit of each of its bits, and the circuits' rounds.

    A routed circuit may have more qubits than its source; those come after its own.
    """

    program: Program
    qubits: IntArray
    rounds: IntArray


def place_wide(
    program: Program,
    device: Device,
    importance: FloatArray,
    on: Sequence[int] | None = None,
    fences: Sequence[Collection[str]] = (),
) -> Placed:
    """Place circuits in as few rounds as go without looking back: in a round no qubit is shared.

    `importance` (circuits,) decides who goes first: wide circuits, which are routed on the best
    free qubits, then circuits of one qubit, which get the best that are left. With `on`, bit i is
    on physical qubit on[i] of one round. `fences` are those of `route`.

    Raises:
        CircuitError: a circuit cannot be routed on the device.
        DeviceError: the device has no couplings, a circuit is wider than the device, or couplings
            between qubits `on` are missing.
        MissingExtraError: Qiskit is not installed.
    """
    if on is not None:
        return _on_qubits(program, device, on)
    if device.is_ideal:
        return Placed(program, np.arange(program.bits), np.zeros(len(program), dtype=np.intp))
    circuits = list(program.circuits)
    placed: dict[int, tuple[int, IntArray]] = {}
    taken: list[set[int]] = [set()]
    order = np.argsort(-importance, kind="stable").tolist()
    for index in (i for i in order if circuits[i].width > 1):
        place, circuits[index], qubits = _routed(circuits[index], device, taken, fences)
        placed[index] = place, qubits
    for index in (i for i in order if circuits[i].width == 1):
        place, qubit = _best_free(device, taken)
        placed[index] = place, np.array([qubit])
    return Placed(
        _with_circuits(program, circuits),
        np.concatenate([placed[index][1] for index in range(len(circuits))]),
        np.array([placed[index][0] for index in range(len(circuits))]),
    )


def _on_qubits(program: Program, device: Device, on: Sequence[int]) -> Placed:
    circuits = list(program.circuits)
    for index, (circuit, first) in enumerate(zip(circuits, program.first_bits, strict=True)):
        if circuit.width > 1 and not device.is_ideal:
            routed = route(circuit, device, on=on[first : first + circuit.width])
            assert routed is not None, "Qiskit routes a circuit whose couplings all exist"
            circuits[index] = routed.circuit
    return Placed(
        replace(program, circuits=tuple(circuits)),
        np.array(on, dtype=np.intp),
        np.zeros(len(circuits), dtype=np.intp),
    )


def wide_copies_that_fit(program: Program, device: Device) -> int:
    """How many copies fit in one round, each with couplings about as good as those of the first.

    The sum of their errors is at most twice that of the first, or at most 0.05. Copies are placed
    as by `place_wide`, one after the other. There is at least one; the ideal device gains nothing
    by a second.

    Raises:
        DeviceError, MissingExtraError: as by `place_wide`.
    """
    if device.is_ideal:
        return 1
    needed = DropIdleCouplings().apply(program)
    wide = [circuit for circuit in needed.circuits if circuit.width > 1]
    alone = len(program) - len(wide)
    taken: set[int] = set()
    most, copies = math.inf, 0
    while True:
        error = 0.0
        for circuit in wide:
            routed = route(circuit, device, taken=taken)
            if routed is None:
                return max(copies, 1)
            taken.update(routed.qubits.tolist())
            error += routed.coupling_error(device)
        free = len(set(usable(device)) - taken)
        if error > most or free < alone * (copies + 1):
            return max(copies, 1)
        if not copies:
            most = max(_WORSE * error, _SMALL)
        copies += 1


def _routed(
    circuit: Circuit, device: Device, taken: list[set[int]], fences: Sequence[Collection[str]]
) -> tuple[int, Circuit, IntArray]:
    """The first round with room for a circuit, the circuit routed there, and its qubits."""
    for place, used in enumerate(taken):
        routed = route(circuit, device, taken=used, fences=fences)
        if routed is not None:
            used.update(routed.qubits.tolist())
            if place == len(taken) - 1:
                taken.append(set())
            return place, *routed
    raise CircuitError(
        f"A circuit on {circuit.width} qubits cannot be routed on {device.name}.",
        "Its usable qubits are not connected well enough; use another device.",
    )


def _best_free(device: Device, taken: list[set[int]]) -> tuple[int, int]:
    """The first round with a free usable qubit, and the best of these; it is taken."""
    for place, used in enumerate(taken):
        free = [qubit for qubit in usable(device) if qubit not in used]
        if free:
            used.add(free[0])
            if place == len(taken) - 1:
                taken.append(set())
            return place, free[0]
    raise AssertionError("the last round is empty, and a device has a usable qubit")


def _with_circuits(program: Program, circuits: list[Circuit]) -> Program:
    """The program with routed circuits; its observables keep their qubits."""
    routed = Program(tuple(circuits), program.inputs, program.parameters)
    owner = np.repeat(np.arange(len(program)), program.widths)
    shift = np.subtract(routed.first_bits, program.first_bits)[owner]
    observables = tuple(
        tuple(int(bit + shift[bit]) for bit in observable) for observable in program.measured
    )
    return replace(routed, observables=observables)
