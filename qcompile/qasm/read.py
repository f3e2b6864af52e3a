"""Reading OpenQASM 3 and 2 files as programs.

Each statement is read by the fast path if it is a common one, else by the grammar of this package,
else by the openqasm3 package, which is loaded when a file needs it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from qcompile import reading
from qcompile.errors import CircuitError, ProgramFileError
from qcompile.ir import Program
from qcompile.qasm.layout import Layout
from qcompile.qasm.marks import Mark


@dataclass(frozen=True)
class Source:
    """The contents of a program file.

    `program` has a circuit for the qubits that couplings connect, and for each of the others; they
    come in the order of declaration (physical qubits in the order of first use), a circuit where
    its first qubit comes. `qubits` has the number of each bit's qubit in that order, by default the
    bit's own. The inputs are those that the file declares, followed by the `products` of two of
    them, if these were asked for. `layout` has the file's registers, and the qubit and bit of every
    bit of the program.
    `notes` list what was left out; `marks` are the resets, barriers and delays, which are not part
    of any circuit, in the order of the file. `name` and `lines` are those of the file, for
    messages.
    """

    program: Program
    layout: Layout
    notes: tuple[str, ...] = ()
    marks: tuple[Mark, ...] = ()
    qubits: tuple[int, ...] = field(default=(), compare=False)
    name: str = field(default="<string>", compare=False)
    lines: int = field(default=1, compare=False)
    products: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.qubits:
            object.__setattr__(self, "qubits", tuple(range(self.program.bits)))


def read(text: str, name: str = "<string>", *, products: bool = False) -> Source:
    """The program of OpenQASM 3 or 2 text, up to a global phase.

    Gates defined in the file are inlined and broadcasts expanded. The line `OPENQASM 2.0;` makes it
    an OpenQASM 2 file. With `products` an angle may contain products of two inputs.

    Raises:
        ProgramFileError: qcompile cannot compile the text; the message starts with `name` and the
            line.
    """
    from qcompile.qasm.messages import bounded
    from qcompile.qasm.reader import Reader

    reader = Reader(text, multiply=products)
    try:
        return Source(*reader.run(), name=name, lines=reader.line, products=reader.products)
    except CircuitError as error:
        raise ProgramFileError(bounded(name, reader.line, str(error))) from error
    except RecursionError as error:
        message = (
            "The program is nested too deeply.\n"
            "  Split sums in brackets into several const declarations."
        )
        raise ProgramFileError(bounded(name, reader.line, message)) from error


def read_file(path: str | Path, *, products: bool = False) -> Source:
    """The program of the file at `path`, by `read`; messages start with the path as given.

    Raises:
        ProgramFileError: the file is missing or not UTF-8 text, or `read` refuses its text.
    """
    try:
        text = reading.decode(reading.read_file(path))
    except OSError as error:
        raise ProgramFileError(
            f"{path}: The file cannot be read: {error.strerror or error}.",
            "Give the path of an OpenQASM 2 or 3 program.",
        ) from error
    except reading.ContentsError as error:
        raise ProgramFileError(
            f"{path}: {error}", "An OpenQASM program is a UTF-8 text file."
        ) from error
    return read(text, str(path), products=products)
