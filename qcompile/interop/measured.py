"""Which circuits of another package's program are kept, and in which order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from qcompile.ir import Circuit


class Measured(NamedTuple):
    """Circuits of which a bit is measured, and the new number of each of their bits.

    `bits` has it by the number before.
    """

    circuits: tuple[Circuit, ...]
    bits: Mapping[int, int]


def measured_in_order(keys: Mapping[int, Any], every: Sequence[int]) -> list[int]:
    """What becomes an observable: what is measured, in the order of the keys, or `every` one.

    `keys` has the sort key of each measured qubit or bit.
    """
    return sorted(keys, key=keys.__getitem__) if keys else list(every)


def measured_circuits(circuits: Sequence[Circuit], order: Sequence[int]) -> Measured:
    """The circuits with a bit in `order`, in that order, and so their qubits.

    Qubits that are not in `order` come last in their circuits.
    """
    place = [(index, qubit) for index, c in enumerate(circuits) for qubit in range(c.width)]
    first = [bit for bit, (_, qubit) in enumerate(place) if qubit == 0]
    chosen: dict[int, dict[int, None]] = {}
    for index, qubit in (place[bit] for bit in order):
        chosen.setdefault(index, {})[qubit] = None
    kept: list[Circuit] = []
    bits: dict[int, int] = {}
    for index, qubits in chosen.items():
        circuit = circuits[index]
        qubits |= dict.fromkeys(range(circuit.width))
        for qubit in qubits:
            bits[first[index] + qubit] = len(bits)
        kept.append(_permuted(circuit, [*qubits]))
    return Measured(tuple(kept), bits)


def _permuted(circuit: Circuit, qubits: Sequence[int]) -> Circuit:
    """The circuit whose qubit k was `qubits[k]`."""
    if qubits == [*range(circuit.width)]:
        return circuit
    place = {qubit: index for index, qubit in enumerate(qubits)}
    moved = (gate.on(*(place[qubit] for qubit in gate.qubits)) for gate in circuit.gates)
    return Circuit(tuple(moved), circuit.width)
