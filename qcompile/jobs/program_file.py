"""A program file compiled: its own registers, a device's own gates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from qcompile.device import Device
from qcompile.errors import CircuitError, DeviceError
from qcompile.jobs.marks import counted, moved, native_starts, on_circuits
from qcompile.noise import usable
from qcompile.passes import Executable, compile
from qcompile.qasm.layout import Layout
from qcompile.qasm.messages import bounded
from qcompile.qasm.names import Version, legal_names, renamed
from qcompile.qasm.read import Source
from qcompile.qasm.write import write


@dataclass(frozen=True, eq=False)
class CompiledFile:
    """The text of the compiled program, what it was made from, and what its reader should know.

    `circuits[i]` is the number, in the source, of the executable's circuit i: qubits that nothing
    is done to, and at level 2 those that are not measured, have none.
    """

    text: str
    executable: Executable
    notes: tuple[str, ...]
    circuits: tuple[int, ...]


def compile_source(source: Source, device: Device, level: int, version: Version) -> CompiledFile:
    """Compile a program file as one program: every qubit in use side by side, in one round.

    At level 2 only what is measured is kept. Level 0 keeps resets, barriers, delays and id.

    Raises:
        CircuitError: level 2, and nothing is measured; or two kinds of qubits.
        DeviceError: the device has too few qubits.
    """
    try:
        return _compiled(source, device, level, version)
    except (CircuitError, DeviceError) as error:
        raise type(error)(bounded(source.name, source.lines, str(error))) from error


def _compiled(source: Source, device: Device, level: int, version: Version) -> CompiledFile:
    notes = list(source.notes)
    used = _used(source, level, notes)
    program = replace(source.program, circuits=tuple(source.program.circuits[i] for i in used))
    layout = _layout_of(source.layout, used)
    marks = on_circuits(source.marks, {circuit: index for index, circuit in enumerate(used)})
    executable = _keep_physical(compile(program, device, level), layout)
    _require_places(executable, layout)
    notes += _notes_on_places(executable, source.layout, layout, version)
    native = executable.native
    if level == 0:
        if marks:
            marks = moved(marks, native_starts(program, device.native))
        if version == "2" and (delays := [mark for mark in marks if mark.word == "delay"]):
            notes.append(f"OpenQASM 2 has no delay: {counted(delays)} left out.")
            marks = [mark for mark in marks if mark.word != "delay"]
    elif left_out := counted(marks, program.circuits):
        notes.append(f"level {level} leaves out {left_out}; level 0 keeps them.")
        marks = []
    if native.late_angles:
        native = executable.template(used, _names(source))
        notes.append(
            f"{len(native.inputs)} native angles are inputs of the result: they follow from the "
            "program's own inputs when it is bound (compile(...).bind in Python)."
        )
    if other := legal_names(native, layout, version):
        native, layout = renamed(native, layout, other)
        pairs = ", ".join(f"{old} is {new}" for old, new in list(other.items())[:8])
        notes.append(f"names that OpenQASM reserves are changed: {pairs}.")
    physical = version == "3" and not device.is_ideal
    qubits = executable.qubits.tolist() if physical else None
    text = write(native, version=version, layout=layout, qubits=qubits, marks=marks)
    return CompiledFile(text, executable, tuple(notes), tuple(used))


def _used(source: Source, level: int, notes: list[str]) -> list[int]:
    """The circuits that are measured or, below level 2, have gates."""
    measured = [bit is not None for bit in source.layout.bits]
    if level == 2 and not any(measured):
        raise CircuitError(
            "The program measures nothing, and level 2 keeps what is measured alone.",
            "Add a measurement, or compile it with --level 1.",
        )
    has_gates = [len(circuit) > 0 for circuit in source.program.circuits]
    dropped = sum(g and not m for g, m in zip(has_gates, measured, strict=True))
    if level == 2 and dropped:
        notes.append(f"{dropped} qubit(s) are not measured: their gates are gone.")
    return [
        circuit
        for circuit, is_measured in enumerate(measured)
        if is_measured or (level < 2 and has_gates[circuit])
    ]


def _layout_of(layout: Layout, circuits: Sequence[int]) -> Layout:
    index_of = {circuit: index for index, circuit in enumerate(circuits)}
    return replace(
        layout,
        qubits=tuple(layout.qubits[circuit] for circuit in circuits),
        bits=tuple(layout.bits[circuit] for circuit in circuits),
        again=tuple((index_of[circuit], slot) for circuit, slot in layout.again),
    )


def _names(source: Source) -> list[str]:
    registers = (*source.layout.qubit_registers, *source.layout.bit_registers)
    return [*source.program.symbols, *(register.name for register in registers)]


def _require_places(executable: Executable, layout: Layout) -> None:
    device, size = executable.device, len(executable.device.qubits)
    if executable.round_count > 1 or (size and executable.qubits.max(initial=0) >= size):
        named = [qubit for qubit in layout.qubits if isinstance(qubit, int)]
        needed = f"qubit ${max(named)}" if named else f"{len(layout)} qubits at once"
        raise DeviceError(
            f"The program does not fit {device.name}.",
            f"It needs {needed}; {device.name} has {size} qubits, "
            f"{len(usable(device))} of them worth using.",
            "Take a larger device, --backend ideal, or split the program.",
        )


def _notes_on_places(
    executable: Executable, declared: Layout, layout: Layout, version: Version
) -> list[str]:
    device, qubits, notes = executable.device, executable.qubits.tolist(), []
    unwanted = [str(qubit) for qubit in qubits if qubit in device.left_out]
    if unwanted:
        notes.append(f"{device.name} leaves out qubit {', '.join(unwanted)}; the program names it.")
    if version == "2" and not device.is_ideal:
        if len(layout) == len(declared):
            places = f"its qubits on {', '.join(map(str, qubits))}, in order"
        else:
            pairs = zip(layout.qubits, qubits, strict=True)
            places = ", ".join(f"{slot[0]}[{slot[1]}] on {qubit}" for slot, qubit in pairs)  # type: ignore[index]
        notes.append(f"OpenQASM 2 names no physical qubits: put {places}.")
    return notes


def _keep_physical(executable: Executable, layout: Layout) -> Executable:
    """The executable on the physical qubits that the file itself names, if it does."""
    named = [qubit for qubit in layout.qubits if isinstance(qubit, int)]
    if not named:
        return executable
    if len(named) != len(layout):
        raise CircuitError(
            "The program names qubits of a register and physical qubits.", "Use one kind of them."
        )
    qubits = np.array(named, dtype=np.intp)
    return replace(executable, qubits=qubits, rounds=np.zeros_like(qubits))
