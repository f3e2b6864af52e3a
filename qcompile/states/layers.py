"""Circuits of several qubits in layers that keep the inputs apart from everything else.

An angle is affine, so a rotation by it is one by its inputs times one by the rest, and every
rotation by inputs is about z between two fixed ones. A layer is, in order: z rotations by inputs,
which are diagonal; runs of rotations that no input enters; couplings. In a batch only the diagonals
differ from row to row.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from qcompile.ir import Angle, Gate
from qcompile.ir.gate import Rotation

_QUARTER = Angle(math.pi / 2)
_FROM_Y: tuple[Rotation, ...] = (("z", -_QUARTER), ("y", -_QUARTER))
_TO_Y: tuple[Rotation, ...] = (("y", _QUARTER), ("z", _QUARTER))
"""Around a rotation about z, they make it one about y."""

_PHASE, _RUN, _COUPLING = range(3)


@dataclass
class Layer:
    """Phases by inputs, then runs, by qubit, then couplings in order."""

    phases: dict[int, Angle] = field(default_factory=dict)
    runs: dict[int, tuple[Rotation, ...]] = field(default_factory=dict)
    couplings: list[Gate] = field(default_factory=list)

    @property
    def is_fixed(self) -> bool:
        """Whether it is the same whatever the symbols are."""
        return not self.phases and not self.is_trained

    @property
    def is_trained(self) -> bool:
        """Whether its runs have symbols."""
        rotations = (rotation for run in self.runs.values() for rotation in run)
        return not all(angle.is_constant for _, angle in rotations)


def layers(gates: Iterable[Gate], width: int, inputs: Collection[str]) -> list[Layer]:
    """The layers of a circuit, at least one, as few as its order of gates allows.

    They keep the distribution of the measurement: z rotations before it are left out.
    """
    qubits, schedule = [_Qubit() for _ in range(width)], _Schedule(width)
    for gate in gates:
        if gate.is_coupling:
            for qubit in gate.qubits:
                schedule.place(qubit, qubits[qubit].take())
            schedule.couple(gate)
            continue
        (qubit,) = gate.qubits
        for axis, angle in gate.rotations:
            for ended in qubits[qubit].turn(axis, *_parted(angle.moderate(), inputs)):
                schedule.place(qubit, ended)
    for qubit in range(width):
        schedule.place(qubit, qubits[qubit].take(is_last=True))
    return schedule.layers or [Layer()]


def _parted(angle: Angle, inputs: Collection[str]) -> tuple[Angle, Angle]:
    """The terms of an angle that are inputs, and the rest."""
    read = tuple((symbol, c) for symbol, c in angle.terms if symbol in inputs)
    rest = tuple((symbol, c) for symbol, c in angle.terms if symbol not in inputs)
    return Angle(0.0, read), Angle(angle.constant, rest)


_Piece = tuple[Angle, tuple[Rotation, ...]]
"""A phase by inputs, then a run."""


class _Qubit:
    """The gates on one qubit that have no layer yet: a phase, then a run."""

    def __init__(self) -> None:
        self._phase, self._run = Angle(), list[Rotation]()

    def turn(self, axis: str, read: Angle, rest: Angle) -> Iterator[_Piece]:
        """Add a rotation by inputs and one by the rest; yields a piece that ended before it."""
        before, after = (_FROM_Y, _TO_Y) if axis == "y" else ((), ())
        if read.terms:
            self._extend(before)
            if self._run:
                yield self.take()
            self._phase += read
            self._extend(after)
        self._extend([(axis, rest)])  # type: ignore[list-item]

    def take(self, *, is_last: bool = False) -> _Piece:
        """What is waiting; nothing waits afterwards."""
        while is_last and self._run and self._run[-1][0] == "z":
            self._run.pop()
        piece = self._phase, tuple(self._run)
        self._phase, self._run = Angle(), []
        return (Angle(), ()) if is_last and not piece[1] else piece

    def _extend(self, rotations: Iterable[Rotation]) -> None:
        for axis, angle in rotations:
            if self._run and self._run[-1][0] == axis:
                angle = self._run.pop()[1].moderate() + angle
            if not angle.equals(0.0):
                self._run.append((axis, angle))


class _Schedule:
    """Layers, in which every gate stands as early as it can."""

    def __init__(self, width: int):
        self.layers: list[Layer] = []
        self._last = [(-1, _COUPLING)] * width
        """Layer and kind of the last gate on each qubit."""

    def place(self, qubit: int, piece: _Piece) -> None:
        phase, run = piece
        if phase.terms:
            self._layer([qubit], _PHASE).phases[qubit] = phase
        if run:
            self._layer([qubit], _RUN).runs[qubit] = run

    def couple(self, gate: Gate) -> None:
        self._layer(gate.qubits, _COUPLING).couplings.append(gate)

    def _layer(self, qubits: Sequence[int], kind: int) -> Layer:
        number = 0
        for qubit in qubits:
            layer, last = self._last[qubit]
            is_free = last < kind or last == kind == _COUPLING
            number = max(number, layer if is_free else layer + 1)
        for qubit in qubits:
            self._last[qubit] = number, kind
        while number >= len(self.layers):
            self.layers.append(Layer())
        return self.layers[number]
