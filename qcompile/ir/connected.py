"""Which qubits pairs of them connect."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def connected(qubits: Iterable[int], pairs: Iterable[Sequence[int]]) -> list[list[int]]:
    """The groups of qubits that pairs connect, also over others, in the order of the qubits."""
    parents: dict[int, int] = {}

    def root(qubit: int) -> int:
        while (parent := parents.get(qubit, qubit)) != qubit:
            parents[qubit] = qubit = parents.get(parent, parent)
        return qubit

    for first, second in pairs:
        parents[root(first)] = root(second)
    groups: dict[int, list[int]] = {}
    for qubit in qubits:
        groups.setdefault(root(qubit), []).append(qubit)
    return list(groups.values())
