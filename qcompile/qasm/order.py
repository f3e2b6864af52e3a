"""The gates of a program in an order that has its marks among them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from qcompile.errors import CircuitError
from qcompile.ir import Gate, Program
from qcompile.qasm.marks import Mark

Event = tuple[Gate | Mark | None, tuple[int, ...]]
"""A gate, a mark or, as None, a measurement, and the bits of the program that it acts on."""

_MEASUREMENT = -1
"""The token of a measurement; that of gate i of its circuit is i, that of mark i is -2 - i."""


def in_order(program: Program, marks: Sequence[Mark]) -> Iterator[Event]:
    """All gates and marks, and the measurements that marks come after.

    On each bit they keep their order; the marks keep theirs where no gate forbids it.

    Raises:
        CircuitError: gates put two marks before each other.
    """
    return _Order(program, marks).events()


class _Order:
    """For each bit its tokens, how many of them, and how many gates, are taken."""

    def __init__(self, program: Program, marks: Sequence[Mark]):
        self._program, self._marks = program, marks
        self._owners = [
            (circuit, first)
            for circuit, first in zip(program.circuits, program.first_bits, strict=True)
            for _ in range(circuit.width)
        ]
        self._tokens = self._all_tokens()
        self._place = {
            (bit, token): place
            for bit, tokens in enumerate(self._tokens)
            for place, token in enumerate(tokens)
            if token < 0 or self._owners[bit][0].width > 1
        }
        self._taken = [0] * program.bits
        self._gates_taken = [0] * program.bits

    def _all_tokens(self) -> list[list[int]]:
        gates: list[list[int]] = [[] for _ in self._owners]
        for circuit, first in zip(self._program.circuits, self._program.first_bits, strict=True):
            for number, gate in enumerate(circuit.gates):
                for qubit in gate.qubits:
                    gates[first + qubit].append(number)
        on_bit = defaultdict[int, list[tuple[bool, int, int]]](list)
        for index, mark in enumerate(self._marks):
            for bit, count in mark.places:
                on_bit[bit].append((count is None, count or 0, index))
        return [_tokens(numbers, sorted(on_bit[bit])) for bit, numbers in enumerate(gates)]

    def events(self) -> Iterator[Event]:
        for index, mark in enumerate(self._marks):
            bit = mark.bits[0]
            yield from self._up_to(bit, self._place[bit, -2 - index] + 1)
        for circuit, first in zip(self._program.circuits, self._program.first_bits, strict=True):
            passed = [0] * circuit.width
            for gate in circuit.gates:
                is_taken = False
                for qubit in gate.qubits:
                    passed[qubit] += 1
                    is_taken |= passed[qubit] <= self._gates_taken[first + qubit]
                if not is_taken:
                    yield gate, tuple(first + qubit for qubit in gate.qubits)

    def _up_to(self, bit: int, stop: int) -> Iterator[Event]:
        """Take the first `stop` tokens of a bit, and all that must come before them."""
        wanted, most = [(bit, stop)], len(self._place) + len(self._marks) + 1
        while wanted:
            bit, stop = wanted[-1]
            if self._taken[bit] >= stop:
                wanted.pop()
                continue
            token = self._tokens[bit][self._taken[bit]]
            event, bits = self._event(bit, token)
            before = [
                (other, self._place[other, token])
                for other in (bits if len(bits) > 1 else ())
                if self._taken[other] < self._place[other, token]
            ]
            if before:
                wanted += reversed(before)
                if len(wanted) > most:
                    raise CircuitError(
                        "The barriers and delays have no order: gates put two before each other.",
                        "Name physical qubits that are coupled, or compile at --level 1.",
                    )
                continue
            for other in bits:
                self._taken[other] += 1
                self._gates_taken[other] += token >= 0
            yield event, bits

    def _event(self, bit: int, token: int) -> Event:
        if token == _MEASUREMENT:
            return None, (bit,)
        if token < 0:
            mark = self._marks[-2 - token]
            return mark, mark.bits
        circuit, first = self._owners[bit]
        gate = circuit.gates[token]
        return gate, tuple(first + qubit for qubit in gate.qubits)


def _tokens(gates: Sequence[int], marks: Sequence[tuple[bool, int, int]]) -> list[int]:
    """The tokens of a bit with these gates and marks.

    A mark is whether it comes after the measurement, the number of gates before it, its number.
    """
    tokens: list[int] = []
    passed, measured = 0, False
    for is_after, count, index in marks:
        stop = len(gates) if is_after else count
        tokens += gates[passed:stop]
        passed = max(passed, stop)
        if is_after and not measured:
            tokens.append(_MEASUREMENT)
            measured = True
        tokens.append(-2 - index)
    return [*tokens, *gates[passed:]]
