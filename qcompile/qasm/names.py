"""Names that OpenQASM reserves, and replacements for them.

A register may be called `in`, `output` or `p` in OpenQASM 2; OpenQASM 3 reserves such names, or its
standard include defines gates with them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Literal

from qcompile.ir import COUPLINGS, FIXED_GATES, ROTATION_GATES, Program
from qcompile.qasm.layout import Layout, Register, Slot

Version = Literal["3", "2"]

_KEYWORDS = """
OPENQASM U CX include def cal defcal defcalgrammar gate opaque extern box let break continue if
else end return for while in switch case default pragma input output const readonly mutable qreg
qubit creg bool bit int uint float angle complex array void duration stretch gphase inv pow ctrl
negctrl durationof delay reset measure barrier true false pi tau euler sizeof
sin cos tan exp ln log sqrt arcsin arccos arctan ceiling floor mod popcount rotl rotr
""".split()  # noqa: SIM905
_INCLUDED = """
u u0 u1 u2 u3 phase cx cy cz ch cp crx cry crz cu cu1 cu3 csx cphase swap ccx cswap rxx rzz
""".split()  # noqa: SIM905
_RESERVED = frozenset((*_KEYWORDS, *_INCLUDED, *FIXED_GATES, *ROTATION_GATES))

_NAME = {"3": re.compile(r"[^\W\d]\w*\Z"), "2": re.compile(r"[a-z][A-Za-z0-9_]*\Z")}


def is_free(name: str, version: Version, *, is_wide: bool = False) -> bool:
    """Whether `name` may be that of a register or an input in a file of this version.

    Files of wide programs also define couplings that the includes lack.
    """
    reserved = name in _RESERVED or (is_wide and name in COUPLINGS)
    return not reserved and _NAME[version].match(name) is not None


def legal_names(program: Program, layout: Layout, version: Version) -> dict[str, str]:
    """A unique replacement for each register and input name that this version does not allow."""
    registers = (*layout.qubit_registers, *layout.bit_registers)
    names = (*program.symbols, *(register.name for register in registers))
    other: dict[str, str] = {}
    for name in names:
        if not is_free(name, version, is_wide=program.is_wide):
            other[name] = _other(name, version, {*names, *other.values()})
    return other


def _other(name: str, version: Version, taken: Collection[str]) -> str:
    if version == "2":
        name = re.sub(r"[^A-Za-z0-9_]", "_", name)
        name = name if re.match("[a-z]", name) else f"r{name}"
    while name in taken or not is_free(name, version):
        name += "_"
    return name


def renamed(program: Program, layout: Layout, other: dict[str, str]) -> tuple[Program, Layout]:
    """The program and its layout with their names replaced according to `other`."""

    def slot(old: Slot) -> Slot:
        return other.get(old[0], old[0]), old[1]

    def registers(old: Iterable[Register]) -> tuple[Register, ...]:
        return tuple(replace(r, name=other.get(r.name, r.name)) for r in old)

    named = replace(
        program,
        circuits=tuple(circuit.rename(other) for circuit in program.circuits),
        inputs=tuple(other.get(name, name) for name in program.inputs),
        parameters=tuple(other.get(name, name) for name in program.parameters),
    )
    return named, replace(
        layout,
        qubit_registers=registers(layout.qubit_registers),
        bit_registers=registers(layout.bit_registers),
        qubits=tuple(q if isinstance(q, int) else slot(q) for q in layout.qubits),
        bits=tuple(None if bit is None else slot(bit) for bit in layout.bits),
        again=tuple((circuit, slot(bit)) for circuit, bit in layout.again),
    )
