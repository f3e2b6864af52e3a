"""Translate every gate into native gates."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

from qcompile.ir import FIXED_GATES, Angle, Circuit, Gate, Program
from qcompile.native import RX, SX, NativeGates
from qcompile.passes.base import Promise, RunPass
from qcompile.simulate import alternating

_PI, _HALF_PI = math.pi, math.pi / 2


@dataclass(frozen=True)
class ToNative(RunPass):
    """Afterwards every gate is one of `native`, or id; gates are translated one by one.

    An id is a delay, and stays where it is: every device has it. All other passes remove it.

    Identities, up to global phase, the right operator acts first: Ry(a) = Rz(pi) sx Rz(a+pi) sx
    (McKay et al., arXiv:1612.00858); Ry(pi/2) = Rz(pi/2) sx Rz(-pi/2); Ry(pi) = x Rz(pi);
    Ry(a) = Rz(pi/2) Rx(a) Rz(-pi/2) where rx is native.
    """

    native: NativeGates = SX

    name: ClassVar[str] = "to_native"
    keeps: ClassVar[Promise] = "unitary"

    def rewrite(self, program: Program) -> Program:
        fixed = {name: tuple(self._gate(Gate(name))) for name in FIXED_GATES}
        return replace(
            program,
            circuits=tuple(
                Circuit(
                    tuple(
                        part
                        for gate in circuit.gates
                        for part in (fixed[gate.name] if gate.angle is None else self._gate(gate))
                    )
                )
                for circuit in program.circuits
            ),
        )

    def _gate(self, gate: Gate) -> Iterator[Gate]:
        if gate.name in (*self.native.gates, "id"):
            yield gate if gate.angle is None else Gate(gate.name, gate.angle.moderate())
            return
        angles = alternating(Circuit((gate,)))
        first, polar, last = [*angles, *[Angle()] * (3 - len(angles))]
        before, middle, after = self._ry(polar)
        if not middle:
            first, last = first + last, Angle()
        yield from _rz(first + before)
        yield from middle
        yield from _rz(last + after)

    def _ry(self, polar: Angle) -> tuple[float, tuple[Gate, ...], float]:
        """Ry(polar) as an rz angle, gates, and an rz angle."""
        if polar.equals(0.0):
            return 0.0, (), 0.0
        if self.native == RX:
            return -_HALF_PI, (Gate("rx", polar.wrapped()),), _HALF_PI
        if polar.equals(_HALF_PI):
            return -_HALF_PI, (Gate("sx"),), _HALF_PI
        if polar.equals(-_HALF_PI):
            return _HALF_PI, (Gate("sx"),), -_HALF_PI
        if polar.equals(_PI):
            return _PI, (Gate("x"),), 0.0
        return 0.0, (Gate("sx"), Gate("rz", (polar + _PI).wrapped()), Gate("sx")), _PI


def _rz(angle: Angle) -> Iterator[Gate]:
    if not angle.equals(0.0):
        yield Gate("rz", angle.wrapped())
