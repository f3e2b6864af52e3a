"""OpenQASM 3 and 2: program files read into programs, and programs written."""

from qcompile.qasm.layout import Layout, Register, Slot
from qcompile.qasm.marks import Mark
from qcompile.qasm.names import Version
from qcompile.qasm.read import Source, read, read_file
from qcompile.qasm.write import write

__all__ = [
    "Layout",
    "Mark",
    "Register",
    "Slot",
    "Source",
    "Version",
    "read",
    "read_file",
    "write",
]
