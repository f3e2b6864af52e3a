"""Programs of OpenQASM text and files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from qcompile.errors import CircuitError
from qcompile.foreign import what_it_is
from qcompile.interop.symbols import Inputs, measured_in_order, split
from qcompile.ir import Program
from qcompile.qasm import Source, read, read_file


def program_of(text_or_path: str | Path, inputs: Inputs = None) -> Program:
    """The program of OpenQASM 2 or 3; what `Program.from_qasm` says."""
    source = _source(text_or_path)
    program = source.program
    registers = {r.name: i for i, r in enumerate(source.layout.bit_registers)}
    bits = {
        qubit: (registers[slot[0]], slot[1])
        for qubit, slot in enumerate(source.layout.bits)
        if slot is not None
    }
    order = measured_in_order(bits, len(program))
    own, trained = split(program.inputs, inputs)
    return Program(tuple(program.circuits[i] for i in order), tuple(own), tuple(trained))


def _source(text_or_path: str | Path) -> Source:
    if isinstance(text_or_path, str):
        text = text_or_path.lstrip()
        if "\n" in text or text.startswith("OPENQASM"):
            return read(text_or_path)
    elif not isinstance(text_or_path, PathLike):
        raise CircuitError(
            f"Program.from_qasm takes OpenQASM text or a path, found {what_it_is(text_or_path)}."
        )
    return read_file(text_or_path)
