"""Fences: rz with symbols of their own that routing keeps side by side, as a barrier's qubits are.

A fence is a set of symbols. Each is the angle of one rz, on a different qubit, and what stands
before one of them in a circuit never depends on what stands after another.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from qcompile.ir import Circuit, Gate, Program
from qcompile.ir.runs import Run, split


@dataclass(frozen=True)
class Fence:
    """The gates of a fence, in the order of their qubits, and its number."""

    number: int
    gates: tuple[Gate, ...]

    @property
    def qubits(self) -> tuple[int, ...]:
        return tuple(gate.qubits[0] for gate in self.gates)


Part = Run | Gate | Fence


def fenced(
    circuit: Circuit, fences: Sequence[Collection[str]]
) -> tuple[Sequence[Circuit], Sequence[Part]]:
    """The runs of a circuit, and its runs, couplings and fences in order.

    Fences of other circuits are ignored.
    """
    number_of = {symbol: number for number, names in enumerate(fences) for symbol in names}
    found: dict[int, list[Gate]] = {}
    for gate in circuit.gates:
        if (number := _number(gate, number_of)) is not None:
            found.setdefault(number, []).append(gate)
    if not found:
        runs, skeleton = split(Program((circuit,), circuit.symbols))
        return runs.circuits, skeleton.circuits[0][1]
    return _Parts(circuit, number_of, found).all()


def _number(gate: Gate, number_of: Mapping[str, int]) -> int | None:
    """The number of the fence that a gate belongs to."""
    terms = gate.angle.terms if gate.angle is not None else ()
    return number_of.get(terms[0][0]) if terms else None


class _Parts:
    """The parts of a circuit; a coupling or a fence first takes what stands before it."""

    def __init__(
        self, circuit: Circuit, number_of: Mapping[str, int], found: Mapping[int, Sequence[Gate]]
    ):
        self._circuit, self._number_of = circuit, number_of
        self._fences = {number: Fence(number, tuple(gates)) for number, gates in found.items()}
        self._waiting: list[deque[Gate]] = [deque() for _ in range(circuit.width)]
        for gate in circuit.gates:
            for qubit in gate.qubits:
                self._waiting[qubit].append(gate)
        self._taken: Counter[Gate | Fence] = Counter()
        self._runs: list[Circuit] = []
        self._parts: list[Part] = []

    def all(self) -> tuple[list[Circuit], list[Part]]:
        seen: Counter[Gate | Fence] = Counter()
        for gate in self._circuit.gates:
            part = self._part(gate)
            if isinstance(part, Fence):
                seen[part] = 1
            elif part is not None:
                seen[part] += 1
            if part is not None and self._taken[part] < seen[part]:
                self._take(part)
        for qubit in range(self._circuit.width):
            self._take_run(qubit)
        return self._runs, self._parts

    def _part(self, gate: Gate) -> Gate | Fence | None:
        """The coupling or the fence that a gate belongs to; None for a gate of a run."""
        number = _number(gate, self._number_of)
        if number is not None:
            return self._fences[number]
        return gate if gate.is_coupling else None

    def _take(self, part: Gate | Fence) -> None:
        wanted = [part]
        while wanted:
            part = wanted[-1]
            for qubit in part.qubits:
                self._take_run(qubit)
                first = self._part(self._waiting[qubit][0])
                if first is not None and first != part:
                    wanted.append(first)
                    break
            else:
                for qubit in part.qubits:
                    self._waiting[qubit].popleft()
                self._taken[part] += 1
                self._parts.append(wanted.pop())

    def _take_run(self, qubit: int) -> None:
        """Take the gates of a qubit up to its next coupling or fence."""
        waiting, gates = self._waiting[qubit], []
        while waiting and self._part(waiting[0]) is None:
            gates.append(waiting.popleft().on(0))
        if gates:
            self._parts.append(Run(qubit, len(self._runs)))
            self._runs.append(Circuit(tuple(gates)))
