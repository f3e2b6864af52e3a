"""Non-gate statements of a program file: kept at level 0, reported at levels 1 and 2."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate

from qcompile.ir import Circuit, Gate, Program
from qcompile.native import NativeGates
from qcompile.passes import lower
from qcompile.qasm.marks import Mark

_ID = Gate("id")


def native_starts(program: Program, native: NativeGates) -> list[list[int]]:
    """For each circuit, the level-0 native gates before gate 0, 1, ... and in total."""
    gates = list(dict.fromkeys(gate for circuit in program.circuits for gate in circuit.gates))
    alone = replace(program, circuits=tuple(Circuit((gate,)) for gate in gates))
    lengths = dict(zip(gates, map(len, lower(alone, 0, native).circuits), strict=True))
    return [
        [0, *accumulate(lengths[gate] for gate in circuit.gates)] for circuit in program.circuits
    ]


def on_circuits(marks: Sequence[Mark], index_of: Mapping[int, int]) -> list[Mark]:
    """The marks on kept circuits, with the circuits' new indices; marks on none are dropped."""
    remaining = []
    for mark in marks:
        pairs = [
            (index_of[circuit], gates)
            for circuit, gates in zip(mark.circuits, mark.gates, strict=True)
            if circuit in index_of
        ]
        if pairs:
            circuits, gates = zip(*pairs, strict=True)
            remaining.append(Mark(mark.text, circuits, gates))
    return remaining


def moved(marks: Sequence[Mark], starts: Sequence[Sequence[int]]) -> list[Mark]:
    """The marks at their places among native gates; `starts` is from `native_starts`."""
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
    """The number of each kind of mark, such as "1 reset, 2 id"; "" for none."""
    counts = Counter(mark.word for mark in marks)
    counts["id"] = sum(gate == _ID for circuit in circuits for gate in circuit.gates)
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count)
