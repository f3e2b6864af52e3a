"""Blocks of a policy file: circuits of several qubits, and the observables measured on them."""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from qcompile.errors import CircuitError, PolicyError
from qcompile.ir import COUPLINGS, Circuit, Gate
from qcompile.limits import MAX_ANGLE_LETTERS, MAX_QUBITS
from qcompile.validation import FirstFault

Number = Annotated[float, Field(allow_inf_nan=False)]
Natural = Annotated[int, Field(ge=0, le=1_000_000)]
Word = Annotated[str, Field(max_length=MAX_ANGLE_LETTERS)]
Observables = Sequence[Sequence[int]]


class BlockFile(BaseModel):
    """Gates on `qubits` qubits: [name, qubit], [name, angle, qubit], [coupling, qubit, qubit]."""

    model_config = ConfigDict(extra="forbid", strict=True)

    qubits: Annotated[int, Field(ge=1, le=MAX_QUBITS)]
    gates: Annotated[list[Annotated[list[Word | Natural | Number], FirstFault()]], FirstFault()]

    def __len__(self) -> int:
        return len(self.gates)

    def check(self, symbols: Set[str]) -> None:
        """Raise PolicyError for the first invalid gate, or the first unknown symbol."""
        for index, parts in enumerate(self.gates):
            try:
                self._check_gate(parts, symbols)
            except CircuitError as error:
                raise PolicyError(f"gates.{index}: {error}") from error

    def _check_gate(self, parts: Sequence[str | float], symbols: Set[str]) -> None:
        name, *rest = parts or [0]
        if not isinstance(name, str):
            raise CircuitError(
                f"{parts!r} is not a gate.",
                'A gate is like ["h", 0], ["ry", "x0", 0] or ["cz", 0, 1].',
            )
        count = 2 if name in COUPLINGS else 1
        angle, qubits = rest[:-count], rest[-count:]
        if len(qubits) < count or len(set(map(str, qubits))) < count:
            needed = "a qubit" if count == 1 else "two different qubits"
            raise CircuitError(f"Gate {name!r} must end with {needed}.")
        for qubit in qubits:
            if not isinstance(qubit, int) or qubit >= self.qubits:
                raise CircuitError(
                    f"Gate {name!r} acts on {qubit!r}.",
                    f"The block has qubits 0 to {self.qubits - 1}; a gate ends with its qubits.",
                )
        if len(angle) > (count == 1):
            raise CircuitError(f"Gate {name!r} has {len(angle)} angles.")
        if count == 2:
            return
        gate = Gate.of(name, angle[0] if angle else None)
        unknown = set(gate.angle.symbols if gate.angle else ()) - symbols
        if unknown:
            raise CircuitError(f"Unknown symbol {min(unknown)!r}.")

    def circuit(self) -> Circuit:
        """The circuit of a block that `check` has accepted."""
        if self.qubits == 1:
            return Circuit.of([parts[:-1] for parts in self.gates])
        return Circuit.of(self.gates, self.qubits)


def check_observables(observables: Observables, widths: Sequence[int]) -> None:
    """Raise PolicyError for an observable with bits outside one block; `widths` are the blocks'."""
    blocks = [block for block, width in enumerate(widths) for _ in range(width)]
    for index, bits in enumerate(observables):
        if max(bits) >= len(blocks):
            raise PolicyError(
                f"observables.{index} has bit {max(bits)}.",
                f"The circuits have bits 0 to {len(blocks) - 1}.",
            )
        if len(set(bits)) < len(bits):
            raise PolicyError(f"observables.{index} has a bit twice.")
        if len({blocks[bit] for bit in bits}) > 1:
            raise PolicyError(
                f"observables.{index} has bits of more than one circuit.",
                "The bits of an observable must belong to one block.",
            )
