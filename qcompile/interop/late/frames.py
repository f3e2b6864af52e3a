"""The signs of rzz: where a qubit is turned by 0 or pi about x, so that no angle is negative.

X on one of its qubits turns the sign of rzz. The rzz of a qubit with nothing but rotations about z
between them are a chain: X before and after it turns the sign of all of them, and the runs at its
ends take it for nothing. With chains as nodes and rzz as edges, every sign along a tree can be
chosen by turning whole chains; an edge that closes a cycle is turned alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from qcompile.interop.late.operations import ABOUT_Z, is_standard

Turn = frozenset[int]
"""A turn by pi where an odd number of these rzz has a negative angle."""


@dataclass
class Chain:
    """The rzz of a chain, in order; `merged` tells of both ends whether a pulse is there anyway."""

    links: list[int] = field(default_factory=list)
    merged: list[bool] = field(default_factory=list)
    turn: Turn = frozenset()


@dataclass(frozen=True)
class Frames:
    """The turns of every rzz of a circuit, in order: of its two chains, and of itself alone."""

    chains: list[tuple[Chain, Chain]]
    alone: list[Turn]

    def begins(self, rzz: int) -> list[Turn]:
        """What each of its qubits is turned by before the rzz."""
        return [c.turn if c.links[0] == rzz else frozenset() for c in self.chains[rzz]]

    def ends(self, rzz: int) -> list[Turn]:
        """What each of its qubits is turned by after the rzz."""
        return [c.turn if c.links[-1] == rzz else frozenset() for c in self.chains[rzz]]

    def turned(self, rzz: int) -> int:
        """The qubit of the two, 0 or 1, that takes the turns of the rzz alone with fewer pulses."""

        def merges(chain: Chain) -> int:
            ends = (chain.links[0], chain.links[-1])
            return sum(
                end == rzz and (merged or bool(chain.turn))
                for end, merged in zip(ends, chain.merged, strict=True)
            )

        first, second = map(merges, self.chains[rzz])
        return int(second > first)


def frames(circuit: Any) -> Frames:
    """The frames of a QuantumCircuit, control flow left out."""
    found: list[Chain] = []
    chains: list[tuple[Chain, Chain]] = []
    current: dict[Any, Chain] = {}
    pulsed: set[Any] = set()
    for instruction in circuit.data:
        operation, qubits = instruction.operation, instruction.qubits
        if is_standard(operation, "rzz"):
            for qubit in qubits:
                if qubit not in current:
                    found.append(Chain(merged=[qubit in pulsed]))
                    current[qubit] = found[-1]
                current[qubit].links.append(len(chains))
            pulsed.difference_update(qubits)
            chains.append((current[qubits[0]], current[qubits[1]]))
        elif not is_standard(operation, *ABOUT_Z):
            is_gate = len(qubits) == 1 and not instruction.clbits and operation.name != "barrier"
            for qubit in qubits:
                if qubit in current:
                    current.pop(qubit).merged.append(is_gate)
            (pulsed.update if is_gate else pulsed.difference_update)(qubits)
    for chain in current.values():
        chain.merged.append(False)
    return Frames(chains, _turned(found, chains))


def _turned(chains: list[Chain], edges: list[tuple[Chain, Chain]]) -> list[Turn]:
    """Set the turn of each chain, and return those that the rzz need alone."""
    reached: set[int] = set()
    for root in sorted(chains, key=lambda chain: sum(chain.merged)):  # a root is never turned
        waiting = [] if id(root) in reached else [root]
        reached.add(id(root))
        while waiting:
            chain = waiting.pop()
            for rzz in chain.links:
                first, second = edges[rzz]
                other = second if first is chain else first
                if id(other) not in reached:
                    reached.add(id(other))
                    other.turn = chain.turn ^ {rzz}
                    waiting.append(other)
    return [a.turn ^ b.turn ^ {rzz} for rzz, (a, b) in enumerate(edges)]
