"""The compilation levels: which passes run, and what they preserve."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.device import IDEAL, Device
from qcompile.errors import CircuitError, DeviceError
from qcompile.foreign import describe, is_qiskit_backend, program_hint
from qcompile.ir import COUPLINGS, Program
from qcompile.native import NativeGates
from qcompile.passes.base import Pass
from qcompile.passes.commute_rz import CommuteRz
from qcompile.passes.drop_unobservable import DropIdleCouplings, DropUnobservable
from qcompile.passes.executable import Executable
from qcompile.passes.fuse_known import FuseKnown
from qcompile.passes.fuse_rotations import FuseRotations
from qcompile.passes.merge_rotations import MergeRotations
from qcompile.passes.place import circuit_importance, place
from qcompile.passes.place_wide import place_wide
from qcompile.passes.to_couplings import ToCouplings
from qcompile.passes.to_native import ToNative
from qcompile.passes.to_rotations import ToRotations

LEVELS = {
    0: "gate by gate, nothing fused",
    1: "preserves the unitary, up to global phase",
    2: "preserves the distribution of the Z measurement from |0>",
}

PASSES: tuple[type[Pass], ...] = (
    ToCouplings,
    CommuteRz,
    DropIdleCouplings,
    FuseKnown,
    ToRotations,
    MergeRotations,
    FuseRotations,
    ToNative,
    DropUnobservable,
)
"""Every pass; the property test of their promises uses this list."""


def pipeline(level: int, native: NativeGates, couplings: Sequence[str] = COUPLINGS) -> list[Pass]:
    """The passes of a level, in order. `couplings` are the device's.

    Raises:
        CircuitError: there is no such level.
    """
    if not isinstance(level, int | float | np.integer) or level not in LEVELS:
        raise CircuitError(
            f"There is no level {level!r}.", f"Levels: {', '.join(map(str, LEVELS))}."
        )
    couple: Pass = ToCouplings(tuple(couplings))
    if level == 0:
        return [couple, ToNative(native)]
    known: list[Pass] = [FuseKnown(), ToRotations(), MergeRotations(), CommuteRz()]
    fuse: list[Pass] = [
        couple,
        *known,
        FuseRotations(),
        ToNative(native),
        CommuteRz(),
        MergeRotations(),
    ]
    return fuse if level == 1 else [DropIdleCouplings(), *fuse, DropUnobservable()]


def lower(
    program: Program, level: int, native: NativeGates, couplings: Sequence[str] = COUPLINGS
) -> Program:
    """`program` in native gates, not yet placed."""
    for step in pipeline(level, native, couplings):
        program = step.apply(program)
    return program


def compile(
    program: Program,
    device: Device = IDEAL,
    level: int = 2,
    importance: FloatArray | None = None,
    *,
    copies: int = 1,
    qubits: Sequence[int] | None = None,
    fences: Sequence[Collection[str]] = (),
) -> Executable:
    """Compile `program` for `device`.

    At level 2 a circuit is sx rz sx or shorter, at level 1 rz sx rz sx rz or shorter (rx and
    rz rx rz where rx is native); unknown angles are fused when the executable is bound.

    `importance` (observables,) says how much the error of an observable matters, by default the
    `<Z>` of each circuit, as `Policy.importance` does: the most important circuits get the best
    qubits (`passes.place`). With
    `copies` the executable contains that many copies of the program, which share its parameters:
    inputs (B, copies * inputs) and results (B, copies * circuits), both copy by copy.

    `qubits` (bits,) are the physical qubits of the program's bits, in place of those that would be
    chosen: all circuits are in one round, and nothing is routed. `fences` are sets of symbols, the
    rz of which stay side by side where a circuit is routed (`passes.fences`).

    Raises:
        CircuitError: `program` is not a Program (the message says how to make one), there is no
            such level, or importance, copies or qubits are out of range.
        DeviceError: `device` is not a Device, or it cannot run a circuit of several qubits.
        MissingExtraError: a circuit of several qubits is to be placed, and Qiskit is missing.
    """
    if not isinstance(program, Program):
        raise CircuitError(
            f"compile takes a Program, found {describe(program)}.", program_hint(program)
        )
    if not isinstance(device, Device):
        call = "load_backend(backend).device" if is_qiskit_backend(device) else "load_device(name)"
        raise DeviceError(f"compile takes a Device, found {describe(device)}.", f"Use {call}.")
    on = None if qubits is None else _checked_qubits(program, device, copies, qubits)
    if program.is_wide:
        return _compile_wide(program, device, level, importance, copies, on, fences)
    if on is None:
        weights = circuit_importance(program, importance, copies)
        places, rounds = place(len(program), device, weights, copies)
    else:
        places, rounds = np.array(on, dtype=np.intp), np.zeros(len(program), dtype=np.intp)
    program = program.side_by_side(copies)
    native = lower(program, level, device.native)
    return Executable(program, native, device, level, places, rounds)


def _checked_qubits(
    program: Program, device: Device, copies: int, qubits: Sequence[int]
) -> list[int]:
    """`qubits` as integers.

    Raises:
        CircuitError: they are not one different qubit of the device for each bit, or there are
            several copies.
    """
    on, most = [int(qubit) for qubit in qubits], len(device.qubits)
    if len(on) != program.bits or len(set(on)) < len(on) or copies != 1:
        raise CircuitError(
            f"{len(set(on))} different qubits do not fit {program.bits * copies} bits.",
            "Give one qubit for each bit of the program, which then has no copies.",
        )
    for qubit in on:
        if qubit < 0 or (qubit >= most and not device.is_ideal):
            raise CircuitError(
                f"{device.name} has no qubit {qubit}.", f"Its qubits are 0 to {most - 1}."
            )
    return on


def _compile_wide(
    program: Program,
    device: Device,
    level: int,
    importance: FloatArray | None,
    copies: int,
    on: Sequence[int] | None,
    fences: Sequence[Collection[str]],
) -> Executable:
    """A program with circuits of several qubits: routed first, then lowered as any other."""
    weights = circuit_importance(program, importance, copies)
    program = program.side_by_side(copies)
    skeleton = DropIdleCouplings().apply(program) if level == 2 else program
    placed = place_wide(skeleton, device, np.tile(weights, copies), on, fences)
    native = lower(placed.program, level, device.native, device.coupling_gates)
    return Executable(program, native, device, level, placed.qubits, placed.rounds)
