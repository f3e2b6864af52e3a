"""Compile a program file to a device's native gates, keeping its registers."""

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
    """The text of the compiled program, its executable, and notes for its reader.

    `circuits[i]` is the source's index of the executable's circuit i: qubits without gates, and at
    level 2 unmeasured qubits, have no circuit.
    """

    text: str
    executable: Executable
    notes: tuple[str, ...]
    circuits: tuple[int, ...]


def compile_source(source: Source, device: Device, level: int, version: Version) -> CompiledFile:
    """Compile a program file as one program: all qubits in use run in parallel, in one round.

    Level 2 keeps only measured qubits. Level 0 keeps resets, barriers, delays and id.

    Raises:
        CircuitError: at level 2 nothing is measured; or virtual and physical qubits are mixed.
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
    return CompiledFile(text, executable, tuple(notes), tuple(used))


def _used(source: Source, level: int, notes: list[str]) -> list[int]:
    """The circuits that are measured or, below level 2, have gates."""
    measured = [bit is not None for bit in source.layout.bits]
    if level == 2 and not any(measured):
        raise CircuitError(
            "The program measures nothing, and level 2 keeps only measured qubits.",
            "Add a measurement, or compile it with --level 1.",
        )
    has_gates = [len(circuit) > 0 for circuit in source.program.circuits]
    dropped = sum(g and not m for g, m in zip(has_gates, measured, strict=True))
    if level == 2 and dropped:
        notes.append(f"{dropped} qubit(s) are not measured: their gates are dropped.")
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
        physical = [qubit for qubit in layout.qubits if isinstance(qubit, int)]
        needed = f"qubit ${max(physical)}" if physical else f"{len(layout)} qubits at once"
        raise DeviceError(
            f"The program does not fit {device.name}.",
            f"It needs {needed}; {device.name} has {size} qubits, "
            f"{len(usable(device))} of them good enough to use.",
            "Take a larger device, --backend ideal, or split the program.",
        )


def _notes_on_places(
    executable: Executable, declared: Layout, layout: Layout, version: Version
) -> list[str]:
    device, qubits, notes = executable.device, executable.qubits.tolist(), []
    excluded = [str(qubit) for qubit in qubits if qubit in device.left_out]
    if excluded:
        qubit_list = ", ".join(excluded)
        notes.append(f"{device.name} excludes qubit {qubit_list}, which the program names.")
    if version == "2" and not device.is_ideal:
        if len(layout) == len(declared):
            places = f"its qubits on {', '.join(map(str, qubits))}, in order"
        else:
            pairs = zip(layout.qubits, qubits, strict=True)
            places = ", ".join(f"{slot[0]}[{slot[1]}] on {qubit}" for slot, qubit in pairs)  # type: ignore[index]
        notes.append(f"OpenQASM 2 cannot name physical qubits: place {places}.")
    return notes


def _keep_physical(executable: Executable, layout: Layout) -> Executable:
    """The executable on the physical qubits named in the file, if it names any."""
    physical = [qubit for qubit in layout.qubits if isinstance(qubit, int)]
    if not physical:
        return executable
    if len(physical) != len(layout):
        raise CircuitError(
            "The program mixes qubits of a register with physical qubits.", "Use only one kind."
        )
    qubits = np.array(physical, dtype=np.intp)
    return replace(executable, qubits=qubits, rounds=np.zeros_like(qubits))
