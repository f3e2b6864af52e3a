"""The native gates of a device, and the response circuit they form."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from qcompile.arrays import IntArray
from qcompile.ir import Angle, Circuit, Gate


@dataclass(frozen=True)
class NativeGates:
    """A set of native gates, and the response circuit: the rotation and pulses of level 2.

    The response circuit takes |0> to a Bloch vector. Its native angle minus the polar angle of that
    vector is `angle_offset_rad`, up to the sign of the polar angle. `one` is the gate that prepares
    |1>, a rotation by pi if it takes an angle. `polar_rad` has, as (gates, angle), the polar angles
    of the level 2 circuits without a rotation.
    """

    gates: tuple[str, ...]
    response: tuple[str, ...]
    angle_offset_rad: float
    one: str
    polar_rad: tuple[tuple[tuple[str, ...], float], ...]

    @classmethod
    @cache
    def of(cls, basis_gates: tuple[str, ...]) -> NativeGates:
        """The native gates for a device with `basis_gates`: fractional rx if it has that.

        Raises:
            ValueError: circuits cannot be compiled to these gates.
        """
        for native in (RX, SX):
            if set(basis_gates) >= set(native.gates):
                return native
        gates = sorted(set(basis_gates))
        raise ValueError(f"basis_gates holds {gates}; it needs rz, sx, x or rz, rx")

    def __str__(self) -> str:
        return " ".join(self.gates)

    @property
    def pulses(self) -> tuple[str, ...]:
        """The gates of the response circuit that take time and add noise."""
        return tuple(name for name in self.response if name != "rz")

    def response_circuit(self, angle: Angle) -> Circuit:
        """The response circuit with that native angle."""
        rotations = ("rz", "rx")
        return Circuit(tuple(Gate(n, angle if n in rotations else None) for n in self.response))

    def polar_angle_rad(self, circuit: Circuit) -> float | None:
        """The polar angle of the state that a level 2 circuit prepares from |0>.

        It is nan for the response circuit, where it depends on the native angle, and None for
        circuits that level 2 does not produce.
        """
        names = tuple(gate.name for gate in circuit.gates)
        return math.nan if names == self.response else dict(self.polar_rad).get(names)


SX = NativeGates(
    gates=("rz", "sx", "x"),
    response=("sx", "rz", "sx"),
    angle_offset_rad=math.pi,
    one="x",
    polar_rad=(((), 0.0), (("sx",), math.pi / 2), (("x",), math.pi)),
)
RX = NativeGates(
    gates=("rz", "rx"), response=("rx",), angle_offset_rad=0.0, one="rx", polar_rad=(((), 0.0),)
)


def slots(circuits: Sequence[Circuit]) -> tuple[IntArray, IntArray]:
    """The circuit of each slot, and the slot's position within that circuit, (slots,) each.

    The slots of a native circuit are its rotations, in order; a circuit without a rotation has one
    unused slot. Slots are ordered circuit by circuit.
    """
    counts = np.array([max(len(circuit.angles), 1) for circuit in circuits], dtype=np.intp)
    owners = np.repeat(np.arange(len(counts)), counts)
    starts = np.cumsum(counts) - counts
    return owners, np.arange(len(owners)) - starts[owners]
