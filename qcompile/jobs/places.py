"""The bits of a compiled program: which are those of its source, and their names in a file."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from qcompile.ir import Program
from qcompile.passes import Executable
from qcompile.qasm.layout import Layout, Register, Slot
from qcompile.qasm.names import Version


def native_bits(executable: Executable) -> list[int]:
    """The native bit of each bit of the source program; the others were gained by routing."""
    source, native = executable.source, executable.native
    shift = np.subtract(native.first_bits, source.first_bits)
    bits = np.arange(source.bits) + np.repeat(shift, source.widths)
    return [int(bit) for bit in bits]


def native_layout(executable: Executable, layout: Layout, taken: Collection[str] = ()) -> Layout:
    """The layout of the source as that of the native program.

    Qubits gained by routing are in a register of their own, whose name is not `taken` and not in
    the layout, and are not measured.
    """
    places, count = native_bits(executable), executable.native.bits
    if count == len(places):
        return layout
    names = {*taken, *(r.name for r in (*layout.qubit_registers, *layout.bit_registers))}
    name = "passed"
    while name in names:
        name += "_"
    register = Register(name, count - len(places))
    free = iter(register.slots())
    bit_of = {place: bit for bit, place in enumerate(places)}
    qubits: list[Slot | int] = []
    bits: list[Slot | None] = []
    for place in range(count):
        bit = bit_of.get(place)
        qubits.append(next(free) if bit is None else layout.qubits[bit])
        bits.append(None if bit is None else layout.bits[bit])
    return replace(
        layout,
        qubit_registers=(*layout.qubit_registers, register),
        qubits=tuple(qubits),
        bits=tuple(bits),
        again=tuple((places[bit], slot) for bit, slot in layout.again),
    )


def bits_of(program: Program, circuits: Sequence[int]) -> list[int]:
    """The bits of some circuits of a program, in order."""
    first_bits, widths = program.first_bits, program.widths
    return [first_bits[i] + qubit for i in circuits for qubit in range(widths[i])]


def round_layout(executable: Executable, circuits: Sequence[int], version: Version) -> Layout:
    """The layout of the native circuits of a round: bit i of register c is the i-th of the source.

    On a device OpenQASM 3 names physical qubits. In OpenQASM 2 bit i is q[i] or, where circuits
    have several qubits, qubit n of the device is q[n].
    """
    device, native = executable.device, bits_of(executable.native, circuits)
    count = len(bits_of(executable.source, circuits))
    physical = executable.qubits[native].tolist()
    qubits: list[Slot | int] = [("q", i) for i in range(len(native))]
    registers = [Register("q", len(native))]
    if not device.is_ideal and version == "3":
        qubits, registers = physical, []
    elif not device.is_ideal and executable.source.is_wide:
        qubits, registers = [("q", n) for n in physical], [Register("q", len(device.qubits))]
    slots = iter(Register("c", count).slots())
    rows = ((executable.source.widths[i], executable.native.widths[i]) for i in circuits)
    bits = [next(slots) if q < own else None for own, width in rows for q in range(width)]
    return Layout(tuple(registers), (Register("c", count),), tuple(qubits), tuple(bits))
