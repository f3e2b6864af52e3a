"""What a program file says beside gates: written at level 0, told of at levels 1 and 2."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from qcompile.ir import Circuit, Gate, Program
from qcompile.passes import lower
from qcompile.passes.to_native import NativeSet
from qcompile.qasm.marks import Mark

_ID = Gate("id")


def with_ids(program: Program, native: NativeSet) -> tuple[Program, list[list[int]]]:
    """`program` at level 0 with its `id` gates, and where each of its gates then begins.

    The second is, for each circuit, the number of native gates before gate 0, 1, ... and before
    the end.
    """
    gates = list(dict.fromkeys(gate for c in program.circuits for gate in c.gates))
    alone = replace(program, circuits=tuple(Circuit((gate,)) for gate in gates))
    lowered = lower(alone, 0, native).circuits
    native_of = {gate: c.gates for gate, c in zip(gates, lowered, strict=True)} | {_ID: (_ID,)}
    circuits, starts = [], []
    for circuit in program.circuits:
        made: list[Gate] = []
        begins = [0]
        for gate in circuit.gates:
            made += native_of[gate]
            begins.append(len(made))
        circuits.append(Circuit(tuple(made)))
        starts.append(begins)
    return replace(program, circuits=tuple(circuits)), starts


def on_circuits(marks: Sequence[Mark], index_of: Mapping[int, int]) -> list[Mark]:
    """The marks on the circuits that are kept, by their new index; those on none are left out."""
    found = []
    for mark in marks:
        pairs = [
            (index_of[circuit], gates)
            for circuit, gates in zip(mark.circuits, mark.gates, strict=True)
            if circuit in index_of
        ]
        if pairs:
            circuits, gates = zip(*pairs, strict=True)
            found.append(Mark(mark.text, circuits, gates))
    return found


def moved(marks: Sequence[Mark], starts: Sequence[Sequence[int]]) -> list[Mark]:
    """The marks among native gates, which begin where `with_ids` says."""
    return [
        replace(
            mark,
            gates=tuple(
                None if gates is None else starts[circuit][gates]
                for circuit, gates in zip(mark.circuits, mark.gates, strict=True)
            ),
        )
        for mark in marks
    ]


def counted(marks: Sequence[Mark], circuits: Sequence[Circuit] = ()) -> str:
    """How many of each there are, such as "1 reset, 2 id"; "" for none."""
    counts = Counter(mark.word for mark in marks)
    counts["id"] = sum(gate == _ID for circuit in circuits for gate in circuit.gates)
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count)
