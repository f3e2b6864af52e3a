"""Runs: the gates on one qubit between two couplings, each a circuit of one qubit.

Passes rewrite runs as they rewrite circuits: `split` takes the runs out of a program, as a program
of their own, and the skeleton puts others in their places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from qcompile.ir.circuit import Circuit
from qcompile.ir.gate import Gate
from qcompile.ir.program import Program


@dataclass(frozen=True)
class Run:
    """The place of a run: its qubit, and its number among the runs of the program."""

    qubit: int
    number: int


@dataclass(frozen=True)
class Skeleton:
    """A program without its runs: for each circuit its width, and runs and couplings in order."""

    program: Program
    circuits: tuple[tuple[int, tuple[Run | Gate, ...]], ...]

    def join(self, runs: Program) -> Program:
        """The program with `runs` in the places of its own, and their late angles."""
        circuits = tuple(_joined(width, parts, runs.circuits) for width, parts in self.circuits)
        return replace(self.program, circuits=circuits, late_angles=runs.late_angles)


def split(program: Program) -> tuple[Program, Skeleton]:
    """The runs of a program, as a program of circuits of one qubit, and its skeleton."""
    runs: list[Circuit] = []
    skeleton: list[tuple[int, tuple[Run | Gate, ...]]] = []
    for circuit in program.circuits:
        if circuit.width == 1:
            skeleton.append((1, (Run(0, len(runs)),)))
            runs.append(circuit)
        else:
            skeleton.append((circuit.width, tuple(_parts(circuit, runs))))
    alone = replace(program, circuits=tuple(runs), observables=())
    return alone, Skeleton(program, tuple(skeleton))


def _parts(circuit: Circuit, runs: list[Circuit]) -> list[Run | Gate]:
    """The runs and couplings of a circuit in order; its runs are appended to `runs`."""
    waiting: list[list[Gate]] = [[] for _ in range(circuit.width)]
    parts: list[Run | Gate] = []

    def end_run(qubit: int) -> None:
        if waiting[qubit]:
            parts.append(Run(qubit, len(runs)))
            runs.append(Circuit(tuple(waiting[qubit])))
            waiting[qubit] = []

    for gate in circuit.gates:
        if gate.is_coupling:
            for qubit in gate.qubits:
                end_run(qubit)
            parts.append(gate)
        else:
            waiting[gate.qubits[0]].append(gate.on(0))
    for qubit in range(circuit.width):
        end_run(qubit)
    return parts


def _joined(width: int, parts: Sequence[Run | Gate], runs: Sequence[Circuit]) -> Circuit:
    if width == 1:
        (run,) = parts
        assert isinstance(run, Run)
        return runs[run.number]
    gates: list[Gate] = []
    for part in parts:
        if isinstance(part, Gate):
            gates.append(part)
        else:
            gates.extend(gate.on(part.qubit) for gate in runs[part.number].gates)
    return Circuit(tuple(gates), width)
