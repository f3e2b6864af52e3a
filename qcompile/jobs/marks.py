"""Statements of a program file that are not gates: kept at level 0, counted at levels 1 and 2.

While a program is compiled, a mark is a gate on each of its bits: an rz with a symbol of its own,
which level 0 leaves where it is. Where a circuit is routed, it moves with its qubit, and those of a
mark stay side by side.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

from qcompile.errors import CircuitError
from qcompile.ir import Angle, Circuit, Gate, Program
from qcompile.jobs.places import native_bits
from qcompile.passes import Executable
from qcompile.qasm.marks import Mark

MAX_KEPT = 200_000
"""The most qubits of all marks together, in programs with circuits of several qubits."""

Place = tuple[int, int]
"""A bit, and a number of gates on it."""
Fences = Sequence[Collection[str]]


def with_marks(
    program: Program, marks: Sequence[Mark], compiled: Callable[[Program, Fences], Executable]
) -> tuple[Executable, list[Mark]]:
    """The program compiled at level 0 by `compiled`, and its marks among the native gates.

    `compiled` gets the program with the gates for its marks, and `passes.fences` of these.

    Raises:
        CircuitError: a program with circuits of several qubits has more than MAX_KEPT marks.
    """
    symbols = _symbols(program, marks)
    names = {name for of_mark in symbols for name in of_mark.values()}
    fences = [set(of_mark.values()) for of_mark in symbols if len(of_mark) > 1]
    executable = compiled(_marked(program, marks, symbols), fences)
    places: dict[str, Place] = {}
    if names:
        source, _ = _unmarked(executable.source, names)
        native, places = _unmarked(executable.native, names)
        executable = replace(executable, source=source, native=native)
    bits = native_bits(executable)
    moved = []
    for mark, own in zip(marks, symbols, strict=True):
        pairs = [places[own[bit]] if bit in own else (bits[bit], None) for bit in mark.bits]
        moved.append(Mark.at(mark.text, pairs))
    return executable, moved


def on_bits(marks: Sequence[Mark], index_of: Mapping[int, int]) -> list[Mark]:
    """The marks on kept bits, with the bits' new numbers; marks on none are dropped."""
    remaining = []
    for mark in marks:
        pairs = [(index_of[bit], gates) for bit, gates in mark.places if bit in index_of]
        if pairs:
            remaining.append(Mark.at(mark.text, pairs))
    return remaining


def counted(marks: Sequence[Mark], circuits: Sequence[Circuit] = ()) -> str:
    """The number of each kind of mark, such as "1 reset, 2 id"; "" for none."""
    counts = Counter(mark.word for mark in marks)
    counts["id"] = sum(gate.name == "id" for circuit in circuits for gate in circuit.gates)
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count)


def _symbols(program: Program, marks: Sequence[Mark]) -> list[dict[int, str]]:
    """For each mark a symbol, not one of the program's, for each of its bits before measurement.

    Marks at the same place share a symbol if all circuits have one qubit.
    """
    prefix = "mark"
    while any(symbol.startswith(prefix) for symbol in program.symbols):
        prefix += "_"
    if program.is_wide and sum(len(mark.bits) for mark in marks) > MAX_KEPT:
        raise CircuitError(
            f"Resets, barriers and delays name more than {MAX_KEPT} qubits in all.",
            "Remove some of them, or compile at --level 1, which leaves them out.",
        )
    symbols = []
    for number, mark in enumerate(marks):
        own = {
            bit: f"{prefix}{bit}_{gates}" + f"_{number}" * program.is_wide
            for bit, gates in mark.places
            if gates is not None
        }
        symbols.append(own)
    return symbols


def _marked(
    program: Program, marks: Sequence[Mark], symbols: Sequence[Mapping[int, str]]
) -> Program:
    """The program with an rz for every symbol."""
    at: dict[Place, dict[str, None]] = {}
    for mark, names in zip(marks, symbols, strict=True):
        for bit, gates in mark.places:
            if gates is not None:
                at.setdefault((bit, gates), {})[names[bit]] = None
    if not at:
        return program
    circuits = tuple(
        replace(circuit, gates=tuple(_with_markers(circuit, first, at)))
        for circuit, first in zip(program.circuits, program.first_bits, strict=True)
    )
    added = dict.fromkeys(name for names in at.values() for name in names)
    return replace(program, circuits=circuits, inputs=(*program.inputs, *added))


def _with_markers(circuit: Circuit, first: int, at: Mapping[Place, Collection[str]]) -> list[Gate]:
    gates: list[Gate] = []
    passed = [0] * circuit.width

    def mark(qubit: int) -> None:
        names = at.get((first + qubit, passed[qubit]), ())
        gates.extend(Gate("rz", Angle(0.0, ((name, 1.0),)), (qubit,)) for name in names)

    for gate in circuit.gates:
        for qubit in gate.qubits:
            mark(qubit)
            passed[qubit] += 1
        gates.append(gate)
    for qubit in range(circuit.width):
        mark(qubit)
    return gates


def _unmarked(program: Program, symbols: Collection[str]) -> tuple[Program, dict[str, Place]]:
    """The program without the rz of these symbols, and where each was."""
    circuits, places = [], {}
    for circuit, first in zip(program.circuits, program.first_bits, strict=True):
        gates, passed = [], [0] * circuit.width
        for gate in circuit.gates:
            if gate.angle is not None and gate.angle.terms and gate.angle.symbols[0] in symbols:
                qubit = gate.qubits[0]
                places[gate.angle.symbols[0]] = (first + qubit, passed[qubit])
                continue
            for qubit in gate.qubits:
                passed[qubit] += 1
            gates.append(gate)
        circuits.append(replace(circuit, gates=tuple(gates)))
    inputs = tuple(name for name in program.inputs if name not in symbols)
    return replace(program, circuits=tuple(circuits), inputs=inputs), places
