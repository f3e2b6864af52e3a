"""Circuits, and angles that are computed from a circuit when it is bound."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from qcompile.errors import CircuitError
from qcompile.ir.angle import Angle
from qcompile.ir.gate import COUPLINGS, Gate
from qcompile.notebook import shortened

_GATE_TEXT = re.compile(
    r"\s*([A-Za-z]\w*)\s*(?:\(([^()]*(?:\([^()]*\)[^()]*)*)\))?(?:@(\d+(?:,\d+)*))?"
)
_QUBIT_0 = (0,)


@dataclass(frozen=True, repr=False)
class Circuit:
    """Gates on `width` qubits that start in `|0>` and are measured in Z at the end.

    Raises:
        CircuitError: a gate acts on a qubit that the circuit does not have.
    """

    gates: tuple[Gate, ...] = ()
    width: int = 1

    def __post_init__(self) -> None:
        if self.width < 1:
            raise CircuitError(f"A circuit cannot have {self.width} qubits.")
        for qubits in {gate.qubits for gate in self.gates} - {_QUBIT_0}:
            if not 0 <= min(qubits) <= max(qubits) < self.width:
                raise CircuitError(
                    f"A gate acts on qubit {max(qubits)} of a circuit on {self.width}.",
                    f"Its qubits are 0 to {self.width - 1}.",
                )

    @classmethod
    def of(cls, gates: Iterable[Sequence[object]], width: int = 1) -> Circuit:
        """The circuit of the policy-file form.

        For one qubit that is [["h"], ["ry", "x0"], ["rz", 0.5]]; in wider circuits the qubits come
        last: [["h", 0], ["ry", "x0", 1], ["cz", 0, 1]].
        """
        return cls(tuple(_gate(gate, width) for gate in gates), width)

    @classmethod
    def parse(cls, text: str, width: int = 1) -> Circuit:
        """The circuit of the text form: "h ry(x0) rz(0.5*x0)", or "h@0 ry(x0)@1 cz@0,1"."""
        gates, position, text = [], 0, text.rstrip()
        while position < len(text):
            match = _GATE_TEXT.match(text, position)
            if match is None:
                raise CircuitError(f"Cannot read a gate at {text[position : position + 20]!r}.")
            qubits = tuple(map(int, match[3].split(","))) if match[3] else _QUBIT_0
            if not match[3] and width > 1:
                raise CircuitError(f"{match[0].strip()!r} names no qubit.", "Write it as h@0.")
            gates.append(Gate.of(match[1], match[2], qubits=qubits))
            position = match.end()
        return cls(tuple(gates), width)

    @property
    def angles(self) -> tuple[Angle, ...]:
        """The angles of the gates, in order."""
        return tuple(gate.angle for gate in self.gates if gate.angle is not None)

    @property
    def gate_counts(self) -> dict[str, int]:
        """The number of gates of each name, by name."""
        return dict(sorted(Counter(gate.name for gate in self.gates).items()))

    @property
    def depth(self) -> int:
        """The most gates that follow each other, each on a qubit of the one before."""
        ends = [0] * self.width
        for gate in self.gates:
            last = 1 + max(ends[qubit] for qubit in gate.qubits)
            for qubit in gate.qubits:
                ends[qubit] = last
        return max(ends)

    @property
    def couplings(self) -> int:
        """The number of gates on two qubits."""
        return sum(gate.is_coupling for gate in self.gates)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Every symbol in the circuit, in order of first use."""
        late = (g.angle.terms for g in self.gates if g.angle is not None and g.angle.terms)
        return tuple(dict.fromkeys(symbol for terms in late for symbol, _ in terms))

    def with_angles(self, angles: Iterable[Angle]) -> Circuit:
        """The circuit with its angles replaced, in order, by as many others."""
        others = iter(angles)
        return self._with(lambda angle: next(others))

    def substitute(self, values: Mapping[str, float]) -> Circuit:
        """The circuit with the symbols in `values` replaced by their numbers."""
        return self._with(lambda angle: angle.substitute(values))

    def rename(self, names: Mapping[str, str]) -> Circuit:
        """The circuit with its symbols renamed according to `names`."""
        return self._with(lambda angle: angle.rename(names))

    def _with(self, changed: Callable[[Angle], Angle]) -> Circuit:
        gates = (
            gate if gate.angle is None else Gate(gate.name, changed(gate.angle), gate.qubits)
            for gate in self.gates
        )
        return Circuit(tuple(gates), self.width)

    def to_lists(self) -> list[list[str | float]]:
        """The policy-file form, from which `Circuit.of` makes an equal circuit."""
        lists: list[list[str | float]] = []
        for gate in self.gates:
            parts: list[str | float] = [gate.name]
            if gate.angle is not None:
                constant = gate.angle.is_constant
                parts.append(gate.angle.constant if constant else str(gate.angle))
            lists.append([*parts, *(gate.qubits if self.width > 1 else ())])
        return lists

    def __len__(self) -> int:
        return len(self.gates)

    def __str__(self) -> str:
        return " ".join(gate.to_text(self.width) for gate in self.gates)

    def __repr__(self) -> str:
        on = f", {self.width} qubits" if self.width > 1 else ""
        return f"Circuit({shortened(str(self))}{on})"


def _gate(parts: Sequence[object], width: int) -> Gate:
    """The gate of a list of its name, its angle if it has one, and its qubits if there are more."""
    example = '["ry", "x0"]' if width == 1 else '["ry", "x0", 0] or ["cz", 0, 1]'
    if isinstance(parts, str) or not isinstance(parts, Sequence) or not parts:
        raise CircuitError(f"{parts!r} is not a gate.", f"A gate is a list like {example}.")
    name, *rest = parts
    if not isinstance(name, str):
        raise CircuitError(f"{name!r} is not a gate name.")
    count = 0 if width == 1 else 2 if name in COUPLINGS else 1
    angle, qubits = (rest[:-count], rest[-count:]) if count else (rest, [0])
    if len(angle) > 1 or len(qubits) != max(count, 1):
        raise CircuitError(f"{parts!r} is not a gate.", f"A gate is a list like {example}.")
    for qubit in qubits:
        if isinstance(qubit, bool) or not isinstance(qubit, int):
            raise CircuitError(f"{qubit!r} is not a qubit.", "Qubits are numbered from 0.")
    return Gate.of(name, angle[0] if angle else None, qubits=tuple(qubits))  # type: ignore[arg-type]


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
