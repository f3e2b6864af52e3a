"""The gates a device runs: what circuits are compiled to, and the response circuit among them."""

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
    """A set of native gates, and the circuit of a rotation and pulses that level 2 compiles to.

    The native angle of that response circuit less the polar angle of the Bloch vector it makes of
    |0> is `angle_offset_rad`, up to the sign of the polar angle. `one` is the gate that prepares
    |1>, as a rotation by pi where it has an angle. `polar_rad` has the polar angles of the circuits
    without a rotation that level 2 may end in, as (gates, angle).
    """

    gates: tuple[str, ...]
    response: tuple[str, ...]
    angle_offset_rad: float
    one: str
    polar_rad: tuple[tuple[tuple[str, ...], float], ...]

    @classmethod
    @cache
    def of(cls, basis_gates: tuple[str, ...]) -> NativeGates:
        """Those that a device with `basis_gates` is compiled to: fractional rx where it has it.

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
        """The gates of the response circuit that take time and bring noise."""
        return tuple(name for name in self.response if name != "rz")

    def response_circuit(self, angle: Angle) -> Circuit:
        """The response circuit with that native angle."""
        rotations = ("rz", "rx")
        return Circuit(tuple(Gate(n, angle if n in rotations else None) for n in self.response))

    def polar_angle_rad(self, circuit: Circuit) -> float | None:
        """The polar angle that a circuit of level 2 makes of |0>.

        It is nan for the response circuit, whose own angle says it, and None for circuits that
        level 2 does not end in.
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
    """The circuit of each slot, and its position within that circuit, (slots,) each.

    The slots of a native circuit are its rotations, in order; a circuit without a rotation has one
    that is not used. Slots come circuit by circuit.
    """
    counts = np.array([max(len(circuit.angles), 1) for circuit in circuits], dtype=np.intp)
    owners = np.repeat(np.arange(len(counts)), counts)
    starts = np.cumsum(counts) - counts
    return owners, np.arange(len(owners)) - starts[owners]
