"""What compilation makes: native circuits on physical qubits, and the numbers that bind them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.device import Device
from qcompile.errors import CircuitError
from qcompile.ir import Angle, Circuit, Gate, Program
from qcompile.ir.table import AngleTable, are_large
from qcompile.simulate import Definitions

_SLOT_GATES = ("rz", "rx")


@dataclass(frozen=True, eq=False, repr=False)
class Executable:
    """A program compiled for a device, once; `bind` gives it its angles, often.

    `source` is the program as it was, `native` the same in the device's gates. The k-th native
    rotation of a circuit (rz, or rx where it is native) is its slot k. `qubits` and `rounds` hold
    the physical qubit and the round of each circuit, (circuits,) integers.
    """

    source: Program
    native: Program
    device: Device
    level: int
    qubits: IntArray
    rounds: IntArray
    bend: Callable[[FloatArray], FloatArray] | None = None
    """Changes the angles (B, circuits) of level 2 after they are bound; `predistorted` sets it."""

    @cached_property
    def slots(self) -> int:
        """The number of native rotations of the longest circuit."""
        return max((len(_rotations(c)) for c in self.native.circuits), default=0)

    def bind(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        """The native angles for x (B, inputs) and theta (parameters,), in radians.

        The shape is (B, circuits) at level 2, where a circuit has one rotation at most, and
        (B, circuits, slots) at levels 0 and 1. A slot that a circuit lacks holds 0. Where angles
        are so large that adding them would round, they are given modulo 2 pi, exactly.

        Raises:
            CircuitError: x or theta has another shape.
        """
        angles = self.bind_slots(x, theta)
        if self.level == 2:
            angles = angles[..., 0]
        return angles

    def bind_slots(self, x: FloatArray, theta: FloatArray) -> FloatArray:
        """`bind` with the slot axis at every level: (B, circuits, slots), one slot at least."""
        self._check(x, theta)
        if self._definitions is not None:
            values = self._definitions(x, theta)
            x = np.concatenate([x, values], axis=1) if self._mixed else values
        angles = self._table(x, theta, large=are_large(x, theta, self._table.largest))
        shape = (len(x), len(self.native), max(self.slots, 1))
        if angles.ndim == 1:
            angles = np.broadcast_to(angles, (len(x), angles.size))
        angles = np.asarray(angles.reshape(shape))
        return angles if self.bend is None else self.bend(angles[..., 0])[..., None]

    def bind_turns(self, x: FloatArray, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Cosine and sine of the angles that `bind_slots` gives, each (B, circuits, slots).

        Where every angle is a polar angle of its own, or that plus pi, they follow from `<Z>`.
        """
        if self._polar_sign is None or self._definitions is None or self.bend is not None:
            angles = self.bind_slots(x, theta)
            return np.cos(angles), np.sin(angles)
        self._check(x, theta)
        z = self._definitions.polar_cosines(x, theta)[:, :, None]
        sine = np.sqrt(1.0 - z * z)
        return (z, sine) if self._polar_sign > 0 else (-z, -sine)

    @property
    def angle_offset_rad(self) -> float:
        """At level 2, the native angle less the polar angle of the ideal Bloch vector.

        It is pi for sx rz sx and 0 for rx, up to the sign of the polar angle.
        """
        return 0.0 if "rx" in self.device.basis_gates else math.pi

    @property
    def has_polar_angles(self) -> bool:
        """Whether every native angle less `angle_offset_rad` lies in [0, pi]."""
        return self._polar_sign is not None

    @cached_property
    def _polar_sign(self) -> int | None:
        """1 if slot 0 of circuit i is polar angle i, -1 if it is that plus pi, else None."""
        if self._definitions is None or not self._definitions.are_polar:
            return None
        for sign, offset in ((1, 0.0), (-1, math.pi)):
            wanted = [Angle.symbol(d.name) + offset for d in self.native.definitions]
            if [[g.angle for g in _rotations(c)] for c in self.native.circuits] == [
                [angle] for angle in wanted
            ]:
                return sign
        return None

    def _check(self, x: FloatArray, theta: FloatArray) -> None:
        inputs, parameters = len(self.source.inputs), len(self.source.parameters)
        shape = getattr(x, "shape", ())
        if shape[1:] != (inputs,) or getattr(theta, "shape", ()) != (parameters,):
            raise CircuitError(
                f"x has shape {np.shape(x)} and theta {np.shape(theta)}.",
                f"The program needs (B, {inputs}) and ({parameters},).",
            )

    @cached_property
    def _definitions(self) -> Definitions | None:
        native = self.native
        if not native.definitions:
            return None
        return Definitions(native.definitions, native.inputs, native.parameters)

    @cached_property
    def _mixed(self) -> bool:
        """Whether slots use the program's own inputs beside the definitions."""
        used = {s for circuit in self.native.circuits for s in circuit.symbols}
        return not used.isdisjoint(self.native.inputs)

    @cached_property
    def _table(self) -> AngleTable:
        slots = max(self.slots, 1)
        angles: list[Angle] = []
        for circuit in self.native.circuits:
            own = [gate.angle for gate in _rotations(circuit) if gate.angle is not None]
            angles += [*own, *[Angle()] * (slots - len(own))]
        defined = tuple(d.name for d in self.native.definitions)
        inputs = (*self.native.inputs, *defined) if self._mixed or not defined else defined
        return AngleTable(angles, inputs, self.native.parameters)

    def __str__(self) -> str:
        return str(self.native)

    @property
    def round_count(self) -> int:
        return int(self.rounds.max(initial=-1)) + 1

    @property
    def copies_that_fit(self) -> int:
        """How many such programs fit side by side in one round, 1 at least.

        It is 1 on the ideal device too, where side by side saves nothing.
        """
        return max(len(self.device.usable) // max(len(self.native), 1), 1)

    def to_qiskit(
        self, x: FloatArray | None = None, theta: FloatArray | None = None, *, measure: bool = True
    ) -> list[Any]:
        """A Qiskit QuantumCircuit for each round, on the physical qubits of the device.

        Native gates alone. Without x (inputs,) and theta (parameters,) the open angles are
        parameters a{i}_{k}, slot k of circuit i, whose values `bind` gives; with both the circuit
        holds numbers. Its register c has a bit for each circuit of the round, in their order;
        `measure=False` leaves measurements and register out.

        Raises:
            CircuitError: x or theta has another shape, or one of them is missing.
            MissingExtraError: Qiskit is not installed.
        """
        from qcompile.interop.qiskit import circuits_of

        return circuits_of(self, x, theta, measure=measure)

    def gate_counts(self) -> list[Counter[str]]:
        """Native gates of each circuit by name."""
        return [Counter(gate.name for gate in c.gates) for c in self.native.circuits]

    @cached_property
    def open_slots(self) -> tuple[tuple[int, int], ...]:
        """Circuit and slot of every angle that is not known before binding, in order.

        With `bend` constant angles are among them, which it changes too.
        """
        return tuple(
            (index, slot)
            for index, circuit in enumerate(self.native.circuits)
            for slot, gate in enumerate(_rotations(circuit))
            if gate.angle is not None and (self.bend is not None or not gate.angle.is_constant)
        )

    def template(
        self, numbers: Sequence[int] | None = None, taken: Collection[str] = ()
    ) -> Program:
        """The native circuits with an input for each of the `open_slots`.

        Slot k of circuit i is the input a{i}_{k}; what `bind_slots` gives is its value. `numbers`
        are what the names call the circuits instead of 0, 1, ...; with names that are `taken` it is
        a_{i}_{k}, with as many underscores as it takes.
        """
        numbers = range(len(self.native)) if numbers is None else numbers
        prefix = "a"
        while any(name.startswith(prefix) and name[len(prefix) :][:1].isdigit() for name in taken):
            prefix += "_"
        names = {(i, slot): f"{prefix}{numbers[i]}_{slot}" for i, slot in self.open_slots}
        circuits = []
        for index, circuit in enumerate(self.native.circuits):
            gates, slot = [], 0
            for gate in circuit.gates:
                is_slot = gate.name in _SLOT_GATES
                name = names.get((index, slot)) if is_slot else None
                gates.append(Gate(gate.name, Angle.symbol(name)) if name else gate)
                slot += is_slot
            circuits.append(Circuit(tuple(gates)))
        return Program(tuple(circuits), tuple(names.values()))


def _rotations(circuit: Circuit) -> list[Gate]:
    return [gate for gate in circuit.gates if gate.name in _SLOT_GATES]
