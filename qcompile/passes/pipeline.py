"""The compilation levels: which passes run, and what they preserve."""

from __future__ import annotations

from collections.abc import Sequence

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
from qcompile.passes.place import checked_importance, place
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
) -> Executable:
    """Compile `program` for `device`.

    At level 2 a circuit is sx rz sx or shorter, at level 1 rz sx rz sx rz or shorter (rx and
    rz rx rz where rx is native); unknown angles are fused when the executable is bound.

    `importance` (observables,) says how much the error of an observable matters, by default the
    `<Z>` of each circuit, as `Policy.importance` does: the most important circuits get the best
    qubits (`passes.place`). With `copies` the executable contains that many copies of the program,
    which share its parameters: inputs (B, copies * inputs) and results (B, copies * observables),
    both copy by copy.

    Raises:
        CircuitError: `program` is not a Program (the message says how to make one), there is no
            such level, or importance or copies are out of range.
        DeviceError: `device` is not a Device.
    """
    if not isinstance(program, Program):
        raise CircuitError(
            f"compile takes a Program, found {describe(program)}.", program_hint(program)
        )
    if not isinstance(device, Device):
        call = "load_backend(backend).device" if is_qiskit_backend(device) else "load_device(name)"
        raise DeviceError(f"compile takes a Device, found {describe(device)}.", f"Use {call}.")
    if program.has_products:
        importance = _of_circuits(program, importance, copies)
        if program.is_wide:
            return _compile_wide(program, device, level, importance, copies)
    qubits, rounds = place(len(program), device, importance, copies)
    program = program.side_by_side(copies)
    native = lower(program, level, device.native)
    return Executable(program, native, device, level, qubits, rounds)


def _of_circuits(program: Program, importance: FloatArray | None, copies: int) -> FloatArray:
    """The importance of each circuit, (circuits,): the sum over its observables."""
    weights = checked_importance(len(program.measured), importance, copies)
    return np.bincount(program.owners, weights, minlength=len(program)).astype(float)


def _compile_wide(
    program: Program, device: Device, level: int, importance: FloatArray, copies: int
) -> Executable:
    """A program with circuits of several qubits: routed first, then lowered as any other."""
    program = program.side_by_side(copies)
    skeleton = DropIdleCouplings().apply(program) if level == 2 else program
    placed = place_wide(skeleton, device, np.tile(importance, copies))
    native = lower(placed.program, level, device.native, device.coupling_gates)
    return Executable(program, native, device, level, placed.qubits, placed.rounds)
