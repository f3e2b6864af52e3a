"""OpenQASM 3 and 2 files read as programs.

The openqasm3 package parses both; it is loaded when a file is read.
"""

from __future__ import annotations

import contextlib
import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qcompile import reading
from qcompile.errors import CircuitError, ProgramFileError
from qcompile.ir import Program
from qcompile.qasm.layout import Layout

_LOCATED = re.compile(r"L(\d+):C\d+: (.*)", re.DOTALL)
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)


@dataclass(frozen=True)
class Source:
    """What a program file holds.

    `program` has one circuit for each qubit, in the order of their declaration (physical qubits
    in the order of their first use); its inputs are those the file declares. `layout` holds the
    file's registers, and the qubit and bit of every circuit.
    """

    program: Program
    layout: Layout


def read(text: str, name: str = "<string>") -> Source:
    """The program that OpenQASM 3 or 2 text stands for, up to a global phase.

    Gates of the file's own are inlined, broadcasts written out, barriers dropped.

    Raises:
        ProgramFileError: the text is no program that qcompile can compile; the message starts
            with `name` and the line.
    """
    from qcompile.qasm.interpreter import Interpreter

    line = 1
    try:
        if not _COMMENT.sub("", text).strip():
            raise CircuitError(
                "The file is empty.", "A program declares qubits and applies gates to them."
            )
        tree = _parse(text)
        if (tree.version or "").startswith("2") and "^" in text:
            # The parser knows OpenQASM 3, where ^ is an exclusive or; in OpenQASM 2 it is **.
            tree = _parse(text.replace("^", "**"))
        interpreter = Interpreter(tree)
        try:
            return Source(*interpreter.run())
        finally:
            line = interpreter.line
    except _SyntaxError as error:
        raise ProgramFileError(f"{name}:{error.line}: {error}") from error
    except CircuitError as error:
        raise ProgramFileError(f"{name}:{line}: {error}") from error
    except RecursionError as error:
        raise ProgramFileError(
            f"{name}:{line}: The program is nested too deeply.",
            "Write long sums and brackets as several const declarations.",
        ) from error


def read_file(path: str | Path) -> Source:
    """The program in the file at `path`; messages start with the path as given.

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
    return read(text, str(path))


class _SyntaxError(CircuitError):
    """The text is not OpenQASM, from `line` on."""

    def __init__(self, line: int, what: str, *hints: str):
        super().__init__(what, *hints)
        self.line = line


def _parse(text: str) -> Any:
    from openqasm3.parser import QASM3ParsingError, parse

    try:
        # ANTLR prints what it finds to standard error besides raising it.
        with contextlib.redirect_stderr(io.StringIO()):
            return parse(text)
    except QASM3ParsingError as error:
        raise _syntax_error(error) from error
    except RecursionError:
        raise
    except Exception as error:
        # The parser lets through whatever its conversion of an odd literal happens to raise.
        raise _SyntaxError(1, f"The parser fails on this text: {error}.") from error


def _syntax_error(error: Exception) -> _SyntaxError:
    if match := _LOCATED.match(str(error)):
        return _SyntaxError(int(match[1]), f"Syntax error: {match[2]}.")
    cause = error.__cause__
    token = getattr(cause.args[0], "offendingToken", None) if cause and cause.args else None
    if token is None:
        return _SyntaxError(1, "Syntax error.", "The text is no OpenQASM 2 or 3 program.")
    if token.text == "<EOF>":
        return _SyntaxError(
            token.line, "The file ends within a statement.", "Is a ';' or a bracket missing?"
        )
    return _SyntaxError(
        token.line, f"Syntax error at {token.text[:60]!r}.", "Is a ';' missing before it?"
    )
