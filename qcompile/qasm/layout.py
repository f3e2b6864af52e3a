"""Layouts: the qubit and the bit of a program file that belong to each bit of a program."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from qcompile.errors import CircuitError


@dataclass(frozen=True)
class Register:
    """A register of qubits or bits. `size` is None for a single one, which takes no index."""

    name: str
    size: int | None

    def slots(self) -> list[Slot]:
        return [(self.name, i) for i in range(1 if self.size is None else self.size)]


Slot = tuple[str, int]
"""A register's name and an index into it; the index is 0 for a single qubit or bit."""


@dataclass(frozen=True)
class Layout:
    """The registers of a program file, and the qubit and bit in them of each bit of a program.

    `qubits[i]` is the slot of bit i, or the number n of its physical qubit $n. `bits[i]` is the
    slot that its measurement writes, or None if it is not measured. `again` holds bits that are
    measured again at once, which gives the same value, and the slots that this writes.

    Raises:
        CircuitError: a register is declared twice, or a slot does not exist or is used twice.
    """

    qubit_registers: tuple[Register, ...]
    bit_registers: tuple[Register, ...]
    qubits: tuple[Slot | int, ...]
    bits: tuple[Slot | None, ...]
    again: tuple[tuple[int, Slot], ...] = ()

    def __post_init__(self) -> None:
        registers = (*self.qubit_registers, *self.bit_registers)
        _require_distinct([r.name for r in registers], "Register")
        _require_distinct(self.qubits, "Qubit")
        written = [*(b for b in self.bits if b is not None), *(slot for _, slot in self.again)]
        _require_distinct(written, "Bit")
        if len(self.qubits) != len(self.bits):
            raise CircuitError(
                f"A layout has {len(self.qubits)} qubits and {len(self.bits)} bits.",
                "It needs one qubit and one bit per circuit; an unmeasured circuit has bit None.",
            )
        _require_slots(self.qubits, self.qubit_registers, "qubit")
        _require_slots(written, self.bit_registers, "bit")
        if not all(0 <= circuit < len(self.bits) for circuit, _ in self.again):
            raise CircuitError("The layout measures a circuit again that it does not contain.")

    @classmethod
    def default(cls, circuits: int) -> Layout:
        """Circuit i on qubit q[i], measured into c[i]."""
        registers = ((Register("q", circuits),), (Register("c", circuits),))
        q, c = registers[0][0].slots(), registers[1][0].slots()
        return cls(*registers, tuple(q), tuple(c))

    def on(self, qubits: Sequence[int]) -> Layout:
        """The same bits, with circuit i on physical qubit `qubits[i]`."""
        return replace(self, qubit_registers=(), qubits=tuple(int(q) for q in qubits))

    def __len__(self) -> int:
        return len(self.qubits)


def _require_distinct(values: Sequence[object], what: str) -> None:
    taken = set()
    for value in values:
        if value in taken:
            raise CircuitError(
                f"{what} {value!r} is used twice.",
                "In one file every circuit needs its own qubit and bit; each round is a file.",
            )
        taken.add(value)


def _require_slots(
    slots: Iterable[Slot | int | None], registers: Iterable[Register], what: str
) -> None:
    known = {slot for register in registers for slot in register.slots()}
    for slot in slots:
        if isinstance(slot, tuple) and slot not in known:
            raise CircuitError(f"No {what} register of the layout has {slot[0]}[{slot[1]}].")
        if isinstance(slot, int) and slot < 0:
            raise CircuitError(f"There is no physical qubit {slot}.", "The first one is 0.")
