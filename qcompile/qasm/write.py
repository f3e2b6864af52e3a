"""Writing programs as OpenQASM 3 or 2."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from qcompile.errors import CircuitError
from qcompile.ir import Gate, Program
from qcompile.qasm.layout import Layout, Register, Slot
from qcompile.qasm.marks import Mark
from qcompile.qasm.names import Version, is_free
from qcompile.qasm.order import in_order

DEFINITIONS: dict[Version, dict[str, str]] = {
    "3": {
        "sxdg": "gate sxdg a { s a; h a; s a; }",
        "ecr": "gate ecr a, b { s a; sx b; cx a, b; x a; }",
    },
    "2": {
        "sx": "gate sx a { sdg a; h a; sdg a; }",
        "sxdg": "gate sxdg a { s a; h a; s a; }",
        "p": "gate p(a) b { u1(a) b; }",
        "ecr": "gate ecr a, b { s a; sdg b; h b; sdg b; cx a, b; x a; }",
    },
}
"""Definitions of the gates that the standard include lacks, for files that use them.

stdgates.inc has no sxdg and no ecr, and the qelib1.inc of the OpenQASM 2 paper has neither sx nor
p. Qiskit's strict parser refuses them without a definition; Cirq, pytket and Qiskit's legacy parser
know them and accept a definition too. (OpenQASM 3 has `inv @ sx`, but Cirq cannot read it.)
"""


def write(
    program: Program,
    *,
    version: Version = "3",
    layout: Layout | None = None,
    qubits: Sequence[int] | None = None,
    marks: Sequence[Mark] = (),
) -> str:
    """`program` as OpenQASM text; every symbol is an `input float[64]`.

    Without a `layout` bit i of the program is q[i], measured into c[i]. With `qubits` bit i is the
    physical qubit $n, n = qubits[i], whatever the layout says. Angles read back as the same floats.
    OpenQASM 2 has neither inputs nor physical qubits. The `marks` are written in order, at their
    places among the gates of their bits.

    Raises:
        CircuitError: the program has late angles, or uses a feature that the version lacks; the
            layout does not fit the program; a name is reserved; or marks have no order.
    """
    layout = Layout.default(program.bits) if layout is None else layout
    layout = layout if qubits is None else layout.on(qubits)
    _check(program, version, layout)
    included = {"3": "stdgates.inc", "2": "qelib1.inc"}[version]
    used = {gate.name for circuit in program.circuits for gate in circuit.gates}
    lines = [f"OPENQASM {version}.0;", f'include "{included}";']
    lines += [text for name, text in DEFINITIONS[version].items() if name in used]
    lines += [f"input float[64] {symbol};" for symbol in program.symbols]
    lines += _declarations(layout.qubit_registers, "qubit", version)
    lines += _declarations(layout.bit_registers, "bit", version)
    places = _places(layout.qubit_registers, layout.qubits, version)
    targets = _places(layout.bit_registers, layout.bits, version)
    lines += _body(program, places, _measurements(layout, places, targets, version), marks, version)
    return "\n".join(lines) + "\n"


def _measurements(
    layout: Layout, places: Sequence[str | None], targets: Sequence[str | None], version: Version
) -> list[list[str]]:
    """The measurements of each bit of the program."""
    written: list[list[str]] = [[] if target is None else [target] for target in targets]
    again = _places(layout.bit_registers, (slot for _, slot in layout.again), version)
    for (bit, _), target in zip(layout.again, again, strict=True):
        written[bit].append(str(target))
    form = "{0} = measure {1};" if version == "3" else "measure {1} -> {0};"
    return [
        [form.format(target, place) for target in targets]
        for targets, place in zip(written, places, strict=True)
    ]


def _body(
    program: Program,
    places: Sequence[str | None],
    measurements: Sequence[list[str]],
    marks: Sequence[Mark],
    version: Version,
) -> Iterator[str]:
    measured: set[int] = set()
    if not marks:
        for circuit, first in zip(program.circuits, program.first_bits, strict=True):
            if circuit.width == 1:
                place = places[first]
                yield from (f"{_gate(gate, version)} {place};" for gate in circuit.gates)
                continue
            for gate in circuit.gates:
                operands = ", ".join(str(places[first + qubit]) for qubit in gate.qubits)
                yield f"{_gate(gate, version)} {operands};"
    for event, bits in in_order(program, marks) if marks else ():
        if event is None:
            yield from measurements[bits[0]]
            measured.update(bits)
        else:
            text = event.text if isinstance(event, Mark) else _gate(event, version)
            yield f"{text} {', '.join(str(places[bit]) for bit in bits)};"
    for bit, statements in enumerate(measurements):
        yield from () if bit in measured else statements


def _check(program: Program, version: Version, layout: Layout) -> None:
    if version not in DEFINITIONS:
        raise CircuitError(f"Unknown OpenQASM version {version!r}.", "Use 3 or 2.")
    if program.late_angles:
        raise CircuitError(
            "A program with late angles cannot be written as OpenQASM.",
            "Write executable.template(), or bind the angles first.",
        )
    if len(layout) != program.bits:
        circuits = "qubits" if program.is_wide else "circuits"
        raise CircuitError(
            f"The layout has {len(layout)} qubits, the program {program.bits} {circuits}.",
            f"A layout needs one qubit per {circuits[:-1]}.",
        )
    if version == "2" and program.symbols:
        raise CircuitError(
            f"OpenQASM 2 has no inputs; the program has {' '.join(program.symbols[:8])}.",
            "Bind them to numbers first, or write OpenQASM 3.",
        )
    if version == "2" and any(isinstance(qubit, int) for qubit in layout.qubits):
        raise CircuitError(
            "OpenQASM 2 cannot name physical qubits.",
            "Write OpenQASM 3, or leave out `qubits`.",
        )
    registers = [r.name for r in (*layout.qubit_registers, *layout.bit_registers)]
    for name in (*program.symbols, *registers):
        if not is_free(name, version, is_wide=program.is_wide):
            raise CircuitError(
                f"{name!r} is not a valid name in OpenQASM {version}.",
                "It is reserved, is the name of a gate, or contains invalid characters.",
                "Rename it.",
            )
    for name in registers:
        if name in program.symbols:
            raise CircuitError(f"{name!r} names a symbol and a register.", "Rename one of them.")


def _declarations(registers: Iterable[Register], kind: str, version: Version) -> Iterator[str]:
    for register in registers:
        if register.size == 0:
            continue
        if version == "2":
            word = {"qubit": "qreg", "bit": "creg"}[kind]
            yield f"{word} {register.name}[{register.size or 1}];"
        else:
            yield f"{kind}{_index(register.size, version)} {register.name};"


def _index(index: int | None, version: Version) -> str:
    return "" if index is None else f"[{index}]"


def _places(
    registers: Iterable[Register], slots: Iterable[Slot | int | None], version: Version
) -> list[str | None]:
    """The text of each slot, such as q[0], q or $3."""
    single = {r.name for r in registers if r.size is None and version == "3"}
    texts: list[str | None] = []
    for slot in slots:
        if slot is None or isinstance(slot, int):
            texts.append(None if slot is None else f"${slot}")
        else:
            name, index = slot
            texts.append(name if name in single else f"{name}[{index}]")
    return texts


def _gate(gate: Gate, version: Version) -> str:
    text = gate.to_text()
    if version == "2":
        # A real number of OpenQASM 2 has a point before its exponent: 1.0e-07, never 1e-07.
        return re.sub(r"\((-?\d+)e", r"(\1.0e", text)
    return text
