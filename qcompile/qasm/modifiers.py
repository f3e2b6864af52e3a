"""The effect of gate statements: inverted, raised to powers, controlled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from qcompile.errors import CircuitError
from qcompile.ir import Angle, Gate
from qcompile.ir.wires import Step, steps
from qcompile.qasm.controlled import conjugated, controlled, inverse
from qcompile.qasm.roots import multiple, principal

_NO_PHASE = Angle()
_CONTROLS = {"cx": "x", "cz": "z"}
"""Couplings that control a gate."""


@dataclass(frozen=True)
class Control:
    """What a controlled gate controls, and of each control whether it must be 1."""

    of: Unitary
    on_one: tuple[bool, ...]


@dataclass(frozen=True)
class Unitary:
    """The effect of a statement: gates on its qubits 0 to `width` - 1, and the phase they lack.

    `is_standard` if the file uses a gate of the table, whose powers multiply rotation angles;
    `control` if it is a controlled gate, whose powers are controlled powers.
    """

    gates: Sequence[Gate]
    width: int = 1
    phase: Angle = _NO_PHASE
    is_standard: bool = False
    control: Control | None = None

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """The gates as `Wires` take them."""
        return steps(self.gates)

    def inverse(self) -> Unitary:
        """The unitary that undoes this one."""
        control = self.control and replace(self.control, of=self.control.of.inverse())
        return replace(self, gates=inverse(self.gates), phase=-self.phase, control=control)

    def controlled(
        self,
        controls: int,
        *,
        on_one: bool = True,
        room: Callable[[int], None] = lambda gates: None,
    ) -> Unitary:
        """The unitary, applied if so many new qubits are all 1, or all 0; they come first.

        `room` is called with the number of gates so far, to raise an error if there are too many.
        """
        inner = self.control or Control(self, ())
        return inner.of._under((*(on_one,) * controls, *inner.on_one), room)

    def _under(self, on_one: tuple[bool, ...], room: Callable[[int], None]) -> Unitary:
        """The unitary under controls, which must be 1 where `on_one` says so, and 0 otherwise."""
        control, count = Control(self, on_one), len(on_one)
        if on_one == (False,) and not self.gates:
            gates = [Gate("p", -self.phase)]
            return Unitary(gates, 1 + self.width, self.phase, control=control)
        if self.gates or self.phase != _NO_PHASE:
            room(1 << min(count - 1, 64))
        flips = [Gate("x", None, (qubit,)) for qubit, on in enumerate(on_one) if not on]
        gates = [*flips]
        for gate in controlled(self.gates, self.phase, count):
            gates.append(gate)
            room(len(gates))
        return Unitary([*gates, *flips], count + self.width, control=control)

    def power(self, exponent: float, room: Callable[[int], None] = lambda gates: None) -> Unitary:
        """The unitary to a real power: a rotation's angle multiplied, gates repeated, or a root.

        `room` is that of `controlled`.

        Raises:
            CircuitError: the power is fractional, and the gates depend on an input or act on
                several qubits in a way that has no root here.
        """
        found = self._multiple(exponent)
        if found is not None:
            return found
        if exponent.is_integer():
            room(len(self.gates) * int(abs(exponent)))
        if self.control is not None:
            return self.control.of.power(exponent, room)._under(self.control.on_one, room)
        if exponent.is_integer():
            count = int(abs(exponent))
            one = self if exponent >= 0 else self.inverse()
            return Unitary([*one.gates] * count, self.width, one.phase * count)
        return self._root(exponent)

    def _multiple(self, exponent: float) -> Unitary | None:
        """The power of a rotation of the table; None for any other gate."""
        if not self.is_standard:
            return None
        before, middle, after = self._parts
        used = _qubits(middle)
        if len(used) != 1:
            return None
        gates = multiple([gate.on(0) for gate in middle], exponent)
        if gates is None:
            return None
        power = [*before, *(gate.on(*used) for gate in gates), *after]
        return replace(self, gates=power, phase=self.phase * exponent)

    def _root(self, exponent: float) -> Unitary:
        """A fractional power: that of what acts on one qubit, between gates and their inverses."""
        before, middle, after = self._parts
        used = _qubits(middle)
        if len(used) < 2:
            gates, phase = principal([gate.on(0) for gate in middle], self.phase, exponent)
            power = [gate.on(*used) for gate in gates]
        elif len(middle) == 1 and middle[0].name in _CONTROLS and self.phase == _NO_PHASE:
            target = Unitary([Gate(_CONTROLS[middle[0].name])], is_standard=True)
            root, phase = target.power(exponent).controlled(1), _NO_PHASE
            power = [gate.on(*(middle[0].qubits[q] for q in gate.qubits)) for gate in root.gates]
        else:
            raise CircuitError(
                f"pow({exponent:g}) of this gate on several qubits is not supported.",
                "Use a whole power, or a power of what it controls.",
            )
        return Unitary([*before, *power, *after], self.width, phase)

    @property
    def _parts(self) -> tuple[Sequence[Gate], Sequence[Gate], Sequence[Gate]]:
        """The gates as A, B and A^-1; A is empty if they act on one qubit."""
        gates = self.gates
        outer = conjugated(gates) if len(_qubits(gates)) > 1 else 0
        return gates[:outer], gates[outer : len(gates) - outer], gates[len(gates) - outer :]


def _qubits(gates: Sequence[Gate]) -> set[int]:
    return {qubit for gate in gates for qubit in gate.qubits}
