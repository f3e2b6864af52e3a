"""The registers of a program file, and the qubits and bits that its operands refer to."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

from openqasm3 import ast

from qcompile.catalogue import nearest
from qcompile.errors import CircuitError
from qcompile.qasm.expressions import Scope, source_of
from qcompile.qasm.layout import Layout, Register, Slot

MAX_PROGRAM_QUBITS = 100_000

RegisterKind = Literal["qubit", "bit"]


@dataclass(frozen=True)
class Reference:
    """Qubits or bits by position; `single` distinguishes q[0] from a register of size 1."""

    kind: RegisterKind
    positions: Sequence[int]
    single: bool


class Registers:
    """The registers declared so far. Positions number all qubits, and all bits, in that order.

    Every method raises CircuitError if a name does not exist or an index is out of range.
    """

    def __init__(self) -> None:
        self._registers: dict[RegisterKind, list[Register]] = {"qubit": [], "bit": []}
        self._places: dict[RegisterKind, list[Slot | int]] = {"qubit": [], "bit": []}
        self._references: dict[str, Reference] = {}

    def declare(self, kind: RegisterKind, name: str, size: int | None, least: int = 1) -> None:
        """Add a register of `size` qubits or bits, not below `least`, or a single one (None)."""
        places = self._places[kind]
        if size is not None and not least <= size <= MAX_PROGRAM_QUBITS - len(places):
            raise CircuitError(
                f"Register {name!r} has {size} {kind}s.",
                f"A program can have 1 to {MAX_PROGRAM_QUBITS}.",
            )
        register, first = Register(name, size), len(places)
        self._registers[kind].append(register)
        places += register.slots()
        self._references[name] = Reference(kind, range(first, len(places)), single=size is None)

    def alias(self, name: str, reference: Reference) -> None:
        """Make `name` refer to `reference`."""
        self._references[name] = reference

    def drop(self, name: str) -> None:
        """Remove the alias `name` that a block made, if there is one."""
        self._references.pop(name, None)

    @contextmanager
    def renamed(self, references: Mapping[str, Reference]) -> Iterator[None]:
        """Within the block, the names in `references` refer to those, hiding all others."""
        before = dict(self._references)
        self._references.update(references)
        yield
        for name in references:
            del self._references[name]
        self._references.update(before)

    def layout(
        self,
        qubits: Sequence[int],
        bit_of: Mapping[int, int | None],
        again: Sequence[tuple[int, int]] = (),
    ) -> Layout:
        """The layout of `qubits`, of which qubit i is measured into bit `bit_of[i]`, if it has one.

        `again` holds the qubits and bits of further measurements.
        """
        places = self._places["bit"]
        bits: list[Slot | None] = []
        for qubit in qubits:
            bit = bit_of.get(qubit)
            place = None if bit is None else places[bit]
            bits.append(place if isinstance(place, tuple) else None)
        index_of = {qubit: index for index, qubit in enumerate(qubits)} if again else {}
        more = [(index_of[qubit], places[bit]) for qubit, bit in again]
        return Layout(
            tuple(self._registers["qubit"]),
            tuple(self._registers["bit"]),
            tuple(self._places["qubit"][qubit] for qubit in qubits),
            tuple(bits),
            tuple((index, place) for index, place in more if isinstance(place, tuple)),
        )

    @property
    def every_qubit(self) -> Sequence[int]:
        """The qubits declared so far."""
        return range(len(self._places["qubit"]))

    def name(self, kind: RegisterKind, position: int) -> str:
        """The name of a qubit or bit in the file, such as q[0], q or $3."""
        place = self._places[kind][position]
        if isinstance(place, int):
            return f"${place}"
        register, index = place
        return register if self._references[register].single else f"{register}[{index}]"

    def resolve(self, node: Any, scope: Scope, kind: RegisterKind | None = None) -> Reference:
        """The qubits or bits that an operand refers to; `kind` says which they must be."""
        match node:
            case ast.Identifier():
                reference = self._lookup(node.name)
            case ast.IndexedIdentifier():
                reference = self._lookup(node.name.name)
                for index in node.indices:
                    reference = _index(reference, index, node, scope)
            case ast.IndexExpression():
                reference = _index(self.resolve(node.collection, scope), node.index, node, scope)
            case ast.Concatenation():
                left, right = self.resolve(node.lhs, scope), self.resolve(node.rhs, scope)
                if left.kind != right.kind:
                    raise CircuitError(f"{source_of(node)!r} mixes qubits and bits.")
                both = (*left.positions, *right.positions)
                if len(set(both)) != len(both):
                    raise CircuitError(f"{source_of(node)!r} contains a {left.kind} twice.")
                reference = Reference(left.kind, both, single=False)
            case _:
                raise CircuitError(f"{source_of(node)!r} is not a qubit or bit.")
        if kind is not None and reference.kind != kind:
            raise CircuitError(f"{source_of(node)!r} is a {reference.kind}, not a {kind}.")
        return reference

    def _lookup(self, name: str) -> Reference:
        if name not in self._references and re.fullmatch(r"\$\d{1,9}", name):
            name = f"${int(name[1:])}"
            if name not in self._references:
                qubits = self._places["qubit"]
                self._references[name] = Reference("qubit", (len(qubits),), single=True)
                qubits.append(int(name[1:]))
        if name not in self._references:
            raise CircuitError(
                f"Unknown register {name!r}.",
                nearest(name, list(self._references)) if self._references else "Declare one first.",
            )
        return self._references[name]


def _index(base: Reference, index: Any, node: Any, scope: Scope) -> Reference:
    if base.single:
        raise CircuitError(f"{source_of(node)!r} has an index, but is a single {base.kind}.")
    positions, single = base.positions, False
    if isinstance(index, ast.DiscreteSet):
        picked = [positions[_in_range(i, positions, node, scope)] for i in index.values]
    elif len(index) != 1:
        raise CircuitError(f"{source_of(node)!r} has more than one index.")
    elif isinstance(index[0], ast.RangeDefinition):
        picked = [positions[i] for i in _range(index[0], positions, node, scope)]
    else:
        picked, single = [positions[_in_range(index[0], positions, node, scope)]], True
    return Reference(base.kind, picked, single)


def _in_range(index_node: Any, positions: Sequence[int], node: Any, scope: Scope) -> int:
    index = scope.whole_number(index_node)
    if not -len(positions) <= index < len(positions):
        raise CircuitError(
            f"Index {index} of {source_of(node)} is out of range.",
            f"The register has size {len(positions)}; the last index is {len(positions) - 1}.",
        )
    return index % len(positions)


def _range(range_node: Any, positions: Sequence[int], node: Any, scope: Scope) -> range:
    step = 1 if range_node.step is None else scope.whole_number(range_node.step)
    if step == 0:
        raise CircuitError(f"The step of {source_of(node)} is 0.")
    first, last = (0, len(positions) - 1)[:: 1 if step > 0 else -1]
    if range_node.start is not None:
        first = _in_range(range_node.start, positions, node, scope)
    if range_node.end is not None:
        last = _in_range(range_node.end, positions, node, scope)
    return range(first, last + (1 if step > 0 else -1), step)
