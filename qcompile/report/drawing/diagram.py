"""What a drawing of circuits shows, whatever its form: wires, and what stands on them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from numbers import Integral

from qcompile.errors import FigureError
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable
from qcompile.report.circuit_words import product_words
from qcompile.report.drawing.columns import Columns, side_by_side

_MOST_ANGLES = 12
"""Of more angles that are computed when a program is bound, a drawing defines the first."""


@dataclass(frozen=True)
class Wire:
    """A wire that starts in |0>; `label` says whose it is.

    The wires of a circuit of several qubits have the same `circuit`, its name. A wire that only
    routing uses is not measured at its end.
    """

    label: str
    circuit: str = ""
    is_measured: bool = True


@dataclass(frozen=True)
class Diagram:
    """Wires below a title, with notes below them; the qubits of a gate are numbers of wires."""

    title: str
    wires: tuple[Wire, ...]
    columns: Columns
    notes: tuple[str, ...] = ()

    @property
    def is_wide(self) -> bool:
        """Whether circuits may have several qubits: it is then folded where it is too long."""
        return any(wire.circuit for wire in self.wires)

    @property
    def groups(self) -> list[range]:
        """The wires of each circuit."""
        starts = [
            index
            for index, wire in enumerate(self.wires)
            if index == 0 or not wire.circuit or wire.circuit != self.wires[index - 1].circuit
        ]
        return [range(*ends) for ends in pairwise([*starts, len(self.wires)])]


def source(program: Program, circuit: int | None = None) -> Diagram:
    """A program's circuits, one of each shape.

    Raises:
        FigureError: there is no such circuit.
    """
    numbers = range(len(program.circuits))
    keys = [shape(program, each) for each in program.circuits]
    shown = _shown(keys, numbers, circuit)
    return Diagram(
        "",
        tuple(wire for index in shown for wire in _wires(program, index, numbers)),
        side_by_side([program.circuits[index] for index in shown]),
        (*_observables(program), *_notes(shown, numbers)),
    )


def compiled(
    executable: Executable, circuit: int | None = None, numbers: Sequence[int] | None = None
) -> tuple[Diagram, Diagram]:
    """The circuits before and after compilation, one of each shape.

    Raises:
        FigureError: there is no such circuit.
    """
    before, after = executable.source, executable.native
    known = range(len(before.circuits)) if numbers is None else numbers
    pairs = list(zip(before.circuits, after.circuits, strict=True))
    shown = _shown([(shape(before, a), shape(after, b)) for a, b in pairs], known, circuit)
    symbols = {symbol for index in shown for symbol in pairs[index][1].symbols}
    late = [str(angle) for angle in after.late_angles if angle.name in symbols]
    if before.is_wide and len(late) > _MOST_ANGLES:
        more = f"and {len(late) - _MOST_ANGLES} more angles that are computed when it is bound"
        late = [*late[:_MOST_ANGLES], more]
    return (
        Diagram(
            "before",
            tuple(wire for index in shown for wire in _wires(before, index, known)),
            side_by_side([pairs[index][0] for index in shown]),
            _observables(before),
        ),
        Diagram(
            f"after, for {executable.device.name}, level {executable.level}",
            tuple(wire for index in shown for wire in _placed(executable, index, known)),
            side_by_side([pairs[index][1] for index in shown]),
            (*late, *_notes(shown, known)),
        ),
    )


def _wires(program: Program, index: int, numbers: Sequence[int]) -> list[Wire]:
    """The wires of a circuit: by its number, and in programs that are wide by their bits."""
    name = f"circuit {numbers[index]}"
    if not program.is_wide:
        return [Wire(name)]
    first, width = program.first_bits[index], program.widths[index]
    return [Wire(f"bit {bit}", name) for bit in range(first, first + width)]


def _placed(executable: Executable, index: int, numbers: Sequence[int]) -> list[Wire]:
    """The same wires on their qubits, and those that routing added."""
    native, own = executable.native, _wires(executable.source, index, numbers)
    first = native.first_bits[index]
    qubits = executable.qubits[first : first + native.widths[index]].tolist()
    if not executable.device.qubits:
        return own
    placed = [
        Wire(f"{wire.label}, qubit {qubit}", wire.circuit)
        for wire, qubit in zip(own, qubits, strict=False)
    ]
    passed = [
        Wire(f"qubit {qubit}, for routing", own[0].circuit, is_measured=False)
        for qubit in qubits[len(own) :]
    ]
    return [*placed, *passed]


def _observables(program: Program) -> tuple[str, ...]:
    """What is measured, where it is not each bit in order."""
    if not program.observables:
        return ()
    return (f"observables: {', '.join(map(product_words, program.measured))}",)


def _shown(
    keys: Sequence[Hashable], numbers: Sequence[int], circuit: int | None
) -> dict[int, list[int]]:
    """The circuits that are drawn, and those that each stands for: of `circuit` itself alone."""
    if circuit is not None:
        if not isinstance(circuit, Integral) or isinstance(circuit, bool):
            raise FigureError(
                f"circuit cannot be of type {type(circuit).__name__}.",
                "It must be a whole number or None.",
            )
        if circuit not in numbers:
            raise FigureError(
                f"There is no circuit {circuit}.",
                f"There is circuit {_ranges(numbers)}."
                if len(numbers) == 1
                else f"There are circuits {_ranges(numbers)}.",
            )
        at = numbers.index(circuit)
        return {at: [at]}
    members: dict[Hashable, list[int]] = {}
    for index, key in enumerate(keys):
        members.setdefault(key, []).append(index)
    return {alike[0]: alike for alike in members.values()}


def _notes(shown: dict[int, list[int]], numbers: Sequence[int]) -> tuple[str, ...]:
    """Which circuits are not drawn, for each one that is drawn in their place."""
    return tuple(
        f"circuit {numbers[first]} stands for {len(alike)} circuits of its shape: "
        f"{_ranges([numbers[i] for i in alike])}"
        for first, alike in shown.items()
        if len(alike) > 1
    )


def _ranges(numbers: Sequence[int]) -> str:
    """0 to 3, 5, 7 to 9."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    words = [f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return ", ".join(words)


def shape(program: Program, circuit: Circuit) -> Hashable:
    """What circuits have in common that differ by the numbers and symbols of their angles alone."""
    parameters, names = set(program.parameters), dict[str, str]()

    def name(symbol: str) -> str:
        kind = "parameter" if symbol in parameters else "input"
        return names.setdefault(symbol, f"{kind} {len(names)}")

    return circuit.width, tuple(
        (
            gate.name,
            gate.qubits,
            gate.angle and (gate.angle.is_constant, tuple(map(name, gate.angle.symbols))),
        )
        for gate in circuit.gates
    )
