"""What a drawing of circuits shows, whatever its form: wires, and what stands on them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from numbers import Integral

from qcompile.errors import FigureError
from qcompile.ir import Circuit, Gate, Program
from qcompile.passes import Executable


@dataclass(frozen=True)
class Wire:
    """A wire that starts in |0> and is measured at its end; `label` says whose it is.

    The gates of all wires of a diagram stand in columns: the k-th of each in column k.
    """

    label: str
    gates: tuple[Gate, ...]


@dataclass(frozen=True)
class Diagram:
    """Wires below a title, with notes below them."""

    title: str
    wires: tuple[Wire, ...]
    notes: tuple[str, ...] = ()

    @property
    def columns(self) -> int:
        """The gates of the longest wire."""
        return max((len(wire.gates) for wire in self.wires), default=0)


def source(program: Program, circuit: int | None = None) -> Diagram:
    """A program's circuits, one of each shape.

    Raises:
        FigureError: there is no such circuit.
    """
    program.require_narrow("A drawing")
    numbers = range(len(program.circuits))
    keys = [shape(program, each) for each in program.circuits]
    shown = _shown(keys, numbers, circuit)
    wires = tuple(Wire(f"circuit {i}", program.circuits[i].gates) for i in shown)
    return Diagram("", wires, _notes(shown, numbers))


def compiled(
    executable: Executable, circuit: int | None = None, numbers: Sequence[int] | None = None
) -> tuple[Diagram, Diagram]:
    """The circuits before and after compilation, one of each shape.

    Raises:
        FigureError: there is no such circuit.
    """
    before, after = executable.source, executable.native
    before.require_narrow("A drawing")
    known = range(len(before.circuits)) if numbers is None else numbers
    pairs = list(zip(before.circuits, after.circuits, strict=True))
    shown = _shown([(shape(before, a), shape(after, b)) for a, b in pairs], known, circuit)
    qubits = [f", qubit {q}" if executable.device.qubits else "" for q in executable.qubits]
    symbols = {symbol for i in shown for symbol in pairs[i][1].symbols}
    late = [str(angle) for angle in after.late_angles if angle.name in symbols]
    return (
        Diagram("before", tuple(Wire(f"circuit {known[i]}", pairs[i][0].gates) for i in shown)),
        Diagram(
            f"after, for {executable.device.name}, level {executable.level}",
            tuple(Wire(f"circuit {known[i]}{qubits[i]}", pairs[i][1].gates) for i in shown),
            (*late, *_notes(shown, known)),
        ),
    )


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

    return tuple(
        (gate.name, gate.angle and (gate.angle.is_constant, tuple(map(name, gate.angle.symbols))))
        for gate in circuit.gates
    )
