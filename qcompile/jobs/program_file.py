"""Compile a program file to a device's native gates, keeping its registers."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from qcompile.device import Device
from qcompile.errors import CircuitError, DeviceError
from qcompile.ir import Circuit, Program
from qcompile.jobs.marks import Fences, counted, on_bits, with_marks
from qcompile.jobs.places import bits_of, native_layout
from qcompile.noise import usable
from qcompile.passes import Executable, compile
from qcompile.qasm.layout import Layout
from qcompile.qasm.messages import bounded
from qcompile.qasm.names import Version, legal_names, renamed
from qcompile.qasm.read import Source
from qcompile.qasm.write import write


@dataclass(frozen=True, eq=False)
class CompiledFile:
    """The text of the compiled program, its executable, and notes for its reader.

    `circuits[i]` is the number of the first qubit of the executable's circuit i in the source:
    qubits without gates, and at level 2 unmeasured circuits, are left out.
    """

    text: str
    executable: Executable
    notes: tuple[str, ...]
    circuits: tuple[int, ...]


def compile_source(source: Source, device: Device, level: int, version: Version) -> CompiledFile:
    """Compile a program file as one program: all qubits in use run in parallel, in one round.

    Level 2 keeps only circuits that are measured. Level 0 keeps resets, barriers, delays and id.

    Raises:
        CircuitError: at level 2 nothing is measured; virtual and physical qubits are mixed; or
            routing leaves no place for a barrier.
        DeviceError: the device has too few qubits or couplings.
        MissingExtraError: qubits are connected, and Qiskit is not installed.
    """
    try:
        return _compiled(source, device, level, version)
    except (CircuitError, DeviceError) as error:
        raise type(error)(bounded(source.name, source.lines, str(error))) from error


def _compiled(source: Source, device: Device, level: int, version: Version) -> CompiledFile:
    notes = list(source.notes)
    program, bits = _part(source, _used(source, level, notes))
    layout = _layout_of(source.layout, bits)
    marks = on_bits(source.marks, {bit: index for index, bit in enumerate(bits)})
    if level == 0:
        executable, marks = with_marks(
            program,
            marks,
            lambda marked, fences: _in_one_round(marked, device, level, layout, fences),
        )
    else:
        executable = _in_one_round(program, device, level, layout)
    numbers = [source.qubits[bits[first]] for first in executable.source.first_bits]
    layout = native_layout(executable, layout, source.program.symbols)
    notes += _notes_on_places(executable, source.layout, layout, version)
    if level == 0:
        if version == "2" and (delays := [mark for mark in marks if mark.word == "delay"]):
            notes.append(f"OpenQASM 2 has no delay: {counted(delays)} left out.")
            marks = [mark for mark in marks if mark.word != "delay"]
    elif left_out := counted(marks, program.circuits):
        notes.append(f"level {level} leaves out {left_out}; level 0 keeps them.")
        marks = []
    native = executable.native
    if native.late_angles:
        native = executable.template(numbers, _names(source))
        notes.append(
            f"{len(native.inputs)} native angles are inputs of the result: they are computed "
            "from the "
            "program's own inputs by binding it (compile(...).bind in Python)."
        )
    if other := legal_names(native, layout, version):
        native, layout = renamed(native, layout, other)
        pairs = ", ".join(f"{old} is {new}" for old, new in list(other.items())[:8])
        notes.append(f"names reserved by OpenQASM are changed: {pairs}.")
    physical = version == "3" and not device.is_ideal
    qubits = executable.qubits.tolist() if physical else None
    text = write(native, version=version, layout=layout, qubits=qubits, marks=marks)
    return CompiledFile(text, executable, tuple(notes), tuple(numbers))


def _used(source: Source, level: int, notes: list[str]) -> list[int]:
    """The circuits that are measured, in part at least, or, below level 2, have gates."""
    program, bits = source.program, source.layout.bits
    measured = [
        any(bit is not None for bit in bits[first : first + width])
        for first, width in zip(program.first_bits, program.widths, strict=True)
    ]
    if level == 2 and not any(measured):
        raise CircuitError(
            "The program measures nothing, and level 2 keeps only measured qubits.",
            "Add a measurement, or compile it with --level 1.",
        )
    has_gates = [len(circuit) > 0 for circuit in program.circuits]
    rows = zip(program.widths, has_gates, measured, strict=True)
    dropped = sum(width for width, g, m in rows if g and not m)
    if level == 2 and dropped:
        notes.append(f"{dropped} qubit(s) are not measured: their gates are dropped.")
    return [
        circuit
        for circuit, is_measured in enumerate(measured)
        if is_measured or (level < 2 and has_gates[circuit])
    ]


def _part(source: Source, circuits: Sequence[int]) -> tuple[Program, list[int]]:
    """The program of some circuits of the source, and their bits there.

    If some bits of wide circuits are measured and others not, the former are its observables.
    """
    whole, bits = source.program, bits_of(source.program, circuits)
    program = replace(whole, circuits=tuple(whole.circuits[i] for i in circuits))
    measured = [i for i, bit in enumerate(bits) if source.layout.bits[bit] is not None]
    if program.is_wide and measured:
        program = replace(program, observables=tuple((i,) for i in measured))
    return program, bits


def _layout_of(layout: Layout, bits: Sequence[int]) -> Layout:
    index_of = {bit: index for index, bit in enumerate(bits)}
    return replace(
        layout,
        qubits=tuple(layout.qubits[bit] for bit in bits),
        bits=tuple(layout.bits[bit] for bit in bits),
        again=tuple((index_of[bit], slot) for bit, slot in layout.again),
    )


def _in_one_round(
    program: Program, device: Device, level: int, layout: Layout, fences: Fences = ()
) -> Executable:
    """The program compiled, on the physical qubits named in the file, if it names any.

    Raises:
        CircuitError: it names some only.
        DeviceError: it does not fit the device.
    """
    physical = [qubit for qubit in layout.qubits if isinstance(qubit, int)]
    if physical:
        if len(physical) != len(layout):
            raise CircuitError(
                "The program mixes qubits of a register with physical qubits.", "Use only one kind."
            )
        if not device.is_ideal and max(physical) >= len(device.qubits):
            raise _does_not_fit(device, f"qubit ${max(physical)}")
        return compile(program, device, level, qubits=physical)
    executable = compile(program, device, level, fences=fences)
    if executable.round_count > 1 and program.is_wide:
        # Circuits that find no place one after the other may find one together.
        with suppress(CircuitError, DeviceError):
            executable = compile(_joined(program), device, level, fences=fences)
    if executable.round_count > 1:
        raise _does_not_fit(device, f"{len(layout)} qubits at once")
    return executable


def _joined(program: Program) -> Program:
    """The program with all its circuits as one."""
    gates = (
        gate.on(*(first + qubit for qubit in gate.qubits))
        for circuit, first in zip(program.circuits, program.first_bits, strict=True)
        for gate in circuit.gates
    )
    return replace(program, circuits=(Circuit(tuple(gates), program.bits),))


def _does_not_fit(device: Device, needed: str) -> DeviceError:
    return DeviceError(
        f"The program does not fit {device.name}.",
        f"It needs {needed}; {device.name} has {len(device.qubits)} qubits, "
        f"{len(usable(device))} of them good enough to use.",
        "Take a larger device, --backend ideal, or split the program.",
    )


def _names(source: Source) -> list[str]:
    registers = (*source.layout.qubit_registers, *source.layout.bit_registers)
    return [*source.program.symbols, *(register.name for register in registers)]


def _notes_on_places(
    executable: Executable, declared: Layout, layout: Layout, version: Version
) -> list[str]:
    device, qubits, notes = executable.device, executable.qubits.tolist(), []
    excluded = [str(qubit) for qubit in qubits if qubit in device.left_out]
    if excluded:
        qubit_list = ", ".join(excluded)
        notes.append(f"{device.name} excludes qubit {qubit_list}, which the program names.")
    if version == "2" and not device.is_ideal:
        if len(layout) == len(declared) and not executable.source.is_wide:
            places = f"its qubits on {', '.join(map(str, qubits))}, in order"
        else:
            slots = (f"${s}" if isinstance(s, int) else f"{s[0]}[{s[1]}]" for s in layout.qubits)
            pairs = zip(slots, qubits, strict=True)
            places = ", ".join(f"{slot} on {qubit}" for slot, qubit in pairs)
        notes.append(f"OpenQASM 2 cannot name physical qubits: place {places}.")
    return notes
