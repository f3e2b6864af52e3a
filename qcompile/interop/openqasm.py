"""Programs from OpenQASM text and files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from qcompile.errors import CircuitError
from qcompile.foreign import describe
from qcompile.interop.measured import measured_circuits, measured_in_order
from qcompile.interop.symbols import Inputs, split
from qcompile.interop.uploads import Uploads
from qcompile.ir import Program
from qcompile.qasm import Source, read, read_file


def program_of(text_or_path: str | Path, inputs: Inputs = None) -> Program:
    """The program of OpenQASM 2 or 3; see `Program.from_qasm`."""
    return _read(text_or_path, inputs, products=False).program


def uploads_of(text_or_path: str | Path, inputs: Inputs = None) -> Uploads:
    """The same, with products of inputs and parameters; see `Ansatz.from_qasm`."""
    return _read(text_or_path, inputs, products=True)


def _read(text_or_path: str | Path, inputs: Inputs, products: bool) -> Uploads:
    source = _source(text_or_path, products)
    program = source.program
    registers = {r.name: i for i, r in enumerate(source.layout.bit_registers)}
    bits = {
        bit: (registers[slot[0]], slot[1])
        for bit, slot in enumerate(source.layout.bits)
        if slot is not None
    }
    every = sorted(range(program.bits), key=source.qubits.__getitem__)
    order = measured_in_order(bits, every)
    measured = measured_circuits(program.circuits, order)
    declared = program.inputs[: len(program.inputs) - len(source.products)]
    input_names, parameter_names = (
        {name: name for name in names} for names in split(declared, inputs)
    )
    observables = [(measured.bits[bit],) for bit in order]
    return Uploads.of(measured.circuits, input_names, parameter_names, source.products, observables)


def _source(text_or_path: str | Path, products: bool) -> Source:
    if isinstance(text_or_path, str):
        text = text_or_path.lstrip()
        if "\n" in text or text.startswith("OPENQASM"):
            return read(text_or_path, products=products)
    elif not isinstance(text_or_path, PathLike):
        raise CircuitError(
            f"{'Ansatz' if products else 'Program'}.from_qasm takes OpenQASM text or a path, "
            f"found {describe(text_or_path)}."
        )
    return read_file(text_or_path, products=products)
