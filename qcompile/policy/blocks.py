"""The circuits of a file: lists of gates, blocks of several qubits, and their observables."""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag

from qcompile.errors import CircuitError, PolicyError
from qcompile.ir import COUPLINGS, Circuit, Gate
from qcompile.limits import MAX_ANGLE_LETTERS, MAX_POLICY_GATES, MAX_QUBITS
from qcompile.validation import FirstFault

Number = Annotated[float, Field(allow_inf_nan=False)]
Natural = Annotated[int, Field(ge=0, le=1_000_000)]
Word = Annotated[str, Field(max_length=MAX_ANGLE_LETTERS)]
Observables = Sequence[Sequence[int]]

MOST_OBSERVABLES = 10_000

CircuitFile = Annotated[list[Annotated[list[Word | Number], FirstFault()]], FirstFault()]
"""A list of gates, each a name and an angle."""


class BlockFile(BaseModel):
    """Gates on `qubits` qubits: [name, qubit], [name, angle, qubit], [coupling, qubit, qubit]."""

    model_config = ConfigDict(extra="forbid", strict=True)

    qubits: Annotated[int, Field(ge=1, le=MAX_QUBITS)]
    gates: Annotated[list[Annotated[list[Word | Natural | Number], FirstFault()]], FirstFault()]

    def __len__(self) -> int:
        return len(self.gates)

    def check(self, symbols: Set[str] | None) -> None:
        """Raise PolicyError for the first invalid gate, or the first symbol not in `symbols`."""
        for index, parts in enumerate(self.gates):
            try:
                self._check_gate(parts, symbols)
            except CircuitError as error:
                raise PolicyError(f"gates.{index}: {error}") from error

    def _check_gate(self, parts: Sequence[str | float], symbols: Set[str] | None) -> None:
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
        used = set(gate.angle.symbols if gate.angle else ())
        if symbols is not None and (unknown := used - symbols):
            raise CircuitError(f"Unknown symbol {min(unknown)!r}.")

    def circuit(self) -> Circuit:
        """The circuit of a block that `check` has accepted."""
        if self.qubits == 1:
            return Circuit.of([parts[:-1] for parts in self.gates])
        return Circuit.of(self.gates, self.qubits)


AnyCircuitFile = Annotated[
    Annotated[CircuitFile, Tag("gates")] | Annotated[BlockFile, Tag("block")],
    Discriminator(lambda value: "block" if isinstance(value, dict | BlockFile) else "gates"),
]


def few_gates(circuits: list[Any]) -> list[Any]:
    """The `circuits`, checked to have at most MAX_POLICY_GATES gates."""
    if sum(map(len, circuits)) > MAX_POLICY_GATES:
        raise ValueError(f"more than {MAX_POLICY_GATES:,} gates")
    return circuits


FewGates = AfterValidator(few_gates)

_Observable = Annotated[list[Natural], Field(min_length=1, max_length=100), FirstFault()]
ObservablesFile = Annotated[
    list[_Observable], Field(min_length=1, max_length=MOST_OBSERVABLES), FirstFault()
]


def read_circuits(
    parts: Sequence[Sequence[Sequence[object]] | BlockFile], symbols: Set[str] | None = None
) -> list[Circuit]:
    """The circuits of lists of gates and of blocks, whose symbols must be among `symbols`.

    Raises:
        PolicyError: a gate is not valid; None allows all symbols.
    """
    circuits = []
    for index, part in enumerate(parts):
        if not isinstance(part, BlockFile):
            try:
                circuits.append(Circuit.of(part))
            except CircuitError as error:
                raise PolicyError(f"circuits.{index}: {error}") from error
            continue
        try:
            part.check(symbols)
        except PolicyError as error:
            raise PolicyError(f"circuits.{index}.{error}") from error
        circuits.append(part.circuit())
    return circuits


def widths_of(parts: Sequence[object]) -> list[int]:
    """The number of qubits of each circuit.

    Raises:
        PolicyError: they are too many.
    """
    widths = [part.qubits if isinstance(part, BlockFile) else 1 for part in parts]
    if sum(widths) > MAX_POLICY_GATES:
        raise PolicyError(
            f"circuits have {sum(widths):,} qubits.", f"At most {MAX_POLICY_GATES:,} are allowed."
        )
    return widths


def circuit_values(circuit: Circuit) -> Any:
    """The gates of a circuit, of several qubits as a block, from which a file reads it back."""
    if circuit.width == 1:
        return circuit.to_lists()
    return {"qubits": circuit.width, "gates": circuit.to_lists()}


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
