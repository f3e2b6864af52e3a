"""A program file compiled: its own registers, a device's own gates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from qcompile.device import Device
from qcompile.errors import CircuitError, DeviceError
from qcompile.ir import Circuit
from qcompile.passes import Executable, compile
from qcompile.qasm.names import legal_names, renamed
from qcompile.qasm.read import Source
from qcompile.qasm.write import Version, write


@dataclass(frozen=True, eq=False)
class CompiledFile:
    """The text of the compiled program, what it was made from, and what its reader should know."""

    text: str
    executable: Executable
    notes: tuple[str, ...]


def compile_source(source: Source, device: Device, level: int, version: Version) -> CompiledFile:
    """Compile a program file as one program: every qubit side by side, in one round.

    At level 2 only what is measured is kept.

    Raises:
        CircuitError: level 2, and nothing is measured; or two kinds of qubits.
        DeviceError: the device has too few qubits.
    """
    program, layout, notes = source.program, source.layout, list(source.notes)
    measured = [bit is not None for bit in layout.bits]
    if level == 2 and not any(measured):
        raise CircuitError(
            "The program measures nothing, and level 2 keeps what is measured alone.",
            "Add a measurement, or compile it with --level 1.",
        )
    if level == 2 and not all(measured):
        notes.append(f"{measured.count(False)} qubit(s) are not measured: their gates are gone.")
        kept = zip(program.circuits, measured, strict=True)
        program = replace(program, circuits=tuple(c if m else Circuit() for c, m in kept))
    executable = _keep_physical(compile(program, device, level), source)
    size = len(device.qubits)
    if executable.round_count > 1 or (size and executable.qubits.max(initial=0) >= size):
        raise DeviceError(
            f"The program does not fit {device.name}.",
            f"It needs {_needs(source)}; {device.name} has {size} qubits, "
            f"{len(device.usable)} of them worth using.",
            "Take a larger device, --backend ideal, or split the program.",
        )
    unwanted = [str(q) for q in executable.qubits.tolist() if q in device.left_out]
    if unwanted:
        notes.append(f"{device.name} leaves out qubit {', '.join(unwanted)}; the program names it.")
    native = executable.native
    if native.definitions:
        native = executable.template()
        notes.append(
            f"{len(native.inputs)} native angles are inputs of the result: they follow from the "
            "program's own inputs when it is bound (compile(...).bind_slots in Python)."
        )
    if other := legal_names(native, layout, version):
        native, layout = renamed(native, layout, other)
        pairs = ", ".join(f"{old} is {new}" for old, new in list(other.items())[:8])
        notes.append(f"names that OpenQASM reserves are changed: {pairs}.")
    physical = version == "3" and not device.is_ideal
    if version == "2" and not device.is_ideal:
        places = ", ".join(map(str, executable.qubits.tolist()))
        notes.append(f"OpenQASM 2 names no physical qubits: put its qubits on {places}, in order.")
    qubits = executable.qubits.tolist() if physical else None
    return CompiledFile(
        write(native, version=version, layout=layout, qubits=qubits), executable, tuple(notes)
    )


def _needs(source: Source) -> str:
    named = [qubit for qubit in source.layout.qubits if isinstance(qubit, int)]
    return f"qubit ${max(named)}" if named else f"{len(source.program)} qubits at once"


def _keep_physical(executable: Executable, source: Source) -> Executable:
    """The executable on the physical qubits that the file itself names, if it does."""
    named = [qubit for qubit in source.layout.qubits if isinstance(qubit, int)]
    if not named:
        return executable
    if len(named) != len(executable.native):
        raise CircuitError(
            "The program names qubits of a register and physical qubits.", "Use one kind of them."
        )
    qubits = np.array(named, dtype=np.intp)
    return replace(executable, qubits=qubits, rounds=np.zeros_like(qubits))
