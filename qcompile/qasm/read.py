"""OpenQASM 3 and 2 files read as programs.

Common statements take the fast path, others the grammar of this package, and what neither knows
the openqasm3 package, statement by statement; it is loaded when a file needs it.
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
    """What a program file holds.

    `program` has one circuit for each qubit, in the order of their declaration (physical qubits
    in the order of their first use); its inputs are those the file declares, and behind them
    `products` of two of them, where they were asked for. `layout` holds the file's registers, and
    the qubit and bit of every circuit. `notes` say what was left out; `marks` are the resets,
    barriers and delays, which no circuit holds, in the order of the file. `name` and `lines` are
    the file's, for messages.
    """

    program: Program
    layout: Layout
    notes: tuple[str, ...] = ()
    marks: tuple[Mark, ...] = ()
    name: str = field(default="<string>", compare=False)
    lines: int = field(default=1, compare=False)
    products: Mapping[str, tuple[str, str]] = field(default_factory=dict)


def read(text: str, name: str = "<string>", *, products: bool = False) -> Source:
    """The program that OpenQASM 3 or 2 text stands for, up to a global phase.

    Gates of the file's own are inlined and broadcasts written out. A file says by
    `OPENQASM 2.0;` that it is one of OpenQASM 2. With `products` an angle may hold products of two
    inputs.

    Raises:
        ProgramFileError: the text is no program that qcompile can compile; the message starts
            with `name` and the line.
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
            "  Write sums within brackets as several const declarations."
        )
        raise ProgramFileError(bounded(name, reader.line, message)) from error


def read_file(path: str | Path, *, products: bool = False) -> Source:
    """What `read` makes of the file at `path`; messages start with the path as given.

    Raises:
        ProgramFileError: the file is missing, is no UTF-8 text, or `read` refuses its text.
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
            f"{path}: {error}", "An OpenQASM program is a file of UTF-8 text."
        ) from error
    return read(text, str(path), products=products)
