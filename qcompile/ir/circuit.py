"""Circuits of one qubit, and angles that are computed from a circuit when it is bound."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from qcompile.errors import CircuitError
from qcompile.ir.angle import Angle
from qcompile.ir.gate import Gate
from qcompile.notebook import shortened

_GATE_TEXT = re.compile(r"\s*([A-Za-z]\w*)\s*(?:\(([^()]*(?:\([^()]*\)[^()]*)*)\))?")


@dataclass(frozen=True, repr=False)
class Circuit:
    """Gates on one qubit that starts in `|0>` and is measured in Z at the end."""

    gates: tuple[Gate, ...] = ()

    @classmethod
    def of(cls, gates: Iterable[Sequence[object]]) -> Circuit:
        """The circuit of the policy-file form [["h"], ["ry", "x0"], ["rz", 0.5]]."""
        parsed = []
        for gate in gates:
            if isinstance(gate, str) or not isinstance(gate, Sequence) or len(gate) not in (1, 2):
                raise CircuitError(
                    f"{gate!r} is not a gate.",
                    'A gate is [name] or [name, angle], like ["ry", "x0"].',
                )
            name, *angle = gate
            if not isinstance(name, str):
                raise CircuitError(f"{name!r} is not a gate name.")
            parsed.append(Gate.of(name, *angle))  # type: ignore[arg-type]
        return cls(tuple(parsed))

    @classmethod
    def parse(cls, text: str) -> Circuit:
        """The circuit of the text form, such as "h ry(x0) rz(0.5*x0)"."""
        gates, position, text = [], 0, text.rstrip()
        while position < len(text):
            match = _GATE_TEXT.match(text, position)
            if match is None:
                raise CircuitError(f"Cannot read a gate at {text[position : position + 20]!r}.")
            gates.append(Gate.of(match[1], match[2]))
            position = match.end()
        return cls(tuple(gates))

    @property
    def angles(self) -> tuple[Angle, ...]:
        """The angles of the gates, in order."""
        return tuple(gate.angle for gate in self.gates if gate.angle is not None)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Every symbol in the circuit, in order of first use."""
        late = (g.angle.terms for g in self.gates if g.angle is not None and g.angle.terms)
        return tuple(dict.fromkeys(symbol for terms in late for symbol, _ in terms))

    def with_angles(self, angles: Iterable[Angle]) -> Circuit:
        """The circuit with its angles replaced, in order, by as many others."""
        others = iter(angles)
        return Circuit(
            tuple(g if g.angle is None else Gate(g.name, next(others)) for g in self.gates)
        )

    def substitute(self, values: Mapping[str, float]) -> Circuit:
        """The circuit with the symbols in `values` replaced by their numbers."""
        return Circuit(
            tuple(Gate(g.name, g.angle and g.angle.substitute(values)) for g in self.gates)
        )

    def rename(self, names: Mapping[str, str]) -> Circuit:
        """The circuit with its symbols renamed according to `names`."""
        return Circuit(tuple(Gate(g.name, g.angle and g.angle.rename(names)) for g in self.gates))

    def to_lists(self) -> list[list[str | float]]:
        """The policy-file form, from which `Circuit.of` makes an equal circuit."""
        return [
            [g.name]
            if g.angle is None
            else [g.name, g.angle.constant if g.angle.is_constant else str(g.angle)]
            for g in self.gates
        ]

    def __len__(self) -> int:
        return len(self.gates)

    def __str__(self) -> str:
        return " ".join(map(str, self.gates))

    def __repr__(self) -> str:
        return f"Circuit({shortened(str(self))})"


EulerPart = Literal["first", "polar", "last"]


@dataclass(frozen=True)
class LateAngle:
    """A symbol whose value is known only when a program is bound.

    The unitary of `block` is Rz(last) Ry(polar) Rz(first) up to global phase, polar in [0, pi];
    the symbol `name` is the one of these three angles that `part` names. cos(polar) is the `<Z>`
    of the block from |0>.
    """

    name: str
    block: Circuit
    part: EulerPart

    def __str__(self) -> str:
        return f"{self.name} = {self.part}{{{self.block}}}"
