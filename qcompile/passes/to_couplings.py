"""Translate every coupling into those of the device."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

from qcompile.ir import COUPLINGS, Gate, Program
from qcompile.passes.base import Promise

_Part = tuple[str, int]
"""A gate on the control, 0, or on the target, 1."""

_AROUND_CX: dict[str, tuple[tuple[_Part, ...], tuple[_Part, ...]]] = {
    "cx": ((), ()),
    "cz": ((("h", 1),), (("h", 1),)),
    "ecr": ((("x", 0),), (("sdg", 0), ("sxdg", 1))),
}
"""The gates before and after a cx that make it this coupling."""
_AROUND: dict[str, tuple[tuple[_Part, ...], tuple[_Part, ...]]] = {
    "cx": ((), ()),
    "cz": ((("h", 1),), (("h", 1),)),
    "ecr": ((("x", 0),), (("s", 0), ("sx", 1))),
}
"""The gates before and after this coupling that make it a cx."""


@dataclass(frozen=True)
class ToCouplings:
    """Afterwards every coupling is one of `couplings`; others become the first of them.

    Found by search over pairs of Clifford gates; equal up to global phase.
    """

    couplings: tuple[str, ...] = COUPLINGS

    name: ClassVar[str] = "to_couplings"
    keeps: ClassVar[Promise] = "unitary"

    def apply(self, program: Program) -> Program:
        if not program.is_wide:
            return program
        circuits = (
            replace(circuit, gates=tuple(p for gate in circuit.gates for p in self._gates(gate)))
            for circuit in program.circuits
        )
        return replace(program, circuits=tuple(circuits))

    def _gates(self, gate: Gate) -> Iterator[Gate]:
        if not gate.is_coupling or gate.name in self.couplings:
            yield gate
            return
        native = self.couplings[0]
        (outer, last), (inner, after) = _AROUND_CX[gate.name], _AROUND[native]
        for name, place in (*outer, *inner):
            yield Gate(name).on(gate.qubits[place])
        yield Gate(native, None, gate.qubits)
        for name, place in (*after, *last):
            yield Gate(name).on(gate.qubits[place])
