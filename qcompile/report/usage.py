"""What circuits use of a device: qubits and couplings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from qcompile.passes import Executable

Pair = tuple[int, int]
"""Two qubits that are coupled, the lower one first."""


@dataclass(frozen=True)
class Usage:
    """The qubits and couplings of an executable's circuits.

    `bits` are the bits of the source program on each qubit, none on those that only routing uses;
    `gates` the number of gates by name, control and target.
    """

    bits: Mapping[int, tuple[int, ...]]
    gates: Mapping[tuple[str, int, int], int]

    @classmethod
    def of(cls, executable: Executable) -> Usage:
        native = executable.native
        bits: dict[int, tuple[int, ...]] = {}
        for bit, qubit in enumerate(executable.bit_qubits.tolist()):
            bits[qubit] = (*bits.get(qubit, ()), bit)
        gates: Counter[tuple[str, int, int]] = Counter()
        for first, circuit in zip(native.first_bits, native.circuits, strict=True):
            for gate in circuit.gates:
                if gate.is_coupling:
                    control, target = (int(executable.qubits[first + q]) for q in gate.qubits)
                    gates[gate.name, control, target] += 1
        passed = {qubit: () for qubit in executable.qubits.tolist() if qubit not in bits}
        return cls(bits | passed, gates)

    @property
    def pairs(self) -> list[Pair]:
        """The pairs of qubits that are coupled, sorted."""
        return sorted({(min(pair), max(pair)) for _, *pair in self.gates})

    @property
    def measured(self) -> list[int]:
        """The qubits that have bits."""
        return [qubit for qubit, bits in self.bits.items() if bits]

    @property
    def passed(self) -> list[int]:
        """The qubits that only routing uses."""
        return [qubit for qubit, bits in self.bits.items() if not bits]
