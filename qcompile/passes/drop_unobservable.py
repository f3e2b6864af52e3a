"""Drop gates that do not affect the Z measurement from |0>."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from qcompile.ir import Circuit, Gate, Program
from qcompile.passes.base import Promise


@dataclass(frozen=True)
class DropUnobservable:
    """Afterwards no qubit begins or ends with a rotation about z, and no late angle is unused.

    |0> is an eigenstate of Rz, and Rz before a Z measurement only changes a phase; both hold
    through couplings that commute with Z on the qubit.
    """

    name: ClassVar[str] = "drop_unobservable"
    keeps: ClassVar[Promise] = "distribution"

    def apply(self, program: Program) -> Program:
        return _with_circuits(program, tuple(map(_trim, program.circuits)))


@dataclass(frozen=True)
class DropIdleCouplings:
    """Afterwards no qubit in |0> controls a coupling, and no cz stands before the measurement.

    With such a control cz and cx are the identity; a cz before Z measurements only changes phases.
    The runs on both sides become one.
    """

    name: ClassVar[str] = "drop_idle_couplings"
    keeps: ClassVar[Promise] = "distribution"

    def apply(self, program: Program) -> Program:
        if not program.is_wide:
            return program
        return replace(program, circuits=tuple(map(_without_idle, program.circuits)))


def without_outer_rz(program: Program, ends: Sequence[bool]) -> Program:
    """A program of one wide circuit without the rz that act on |0>, and without late ones.

    The last rz of a qubit is dropped where `ends` (qubits,) says so: that keeps the distribution of
    its Z measurement; without, the state from |0> is kept, up to global phase.
    """
    (circuit,) = program.circuits
    return _with_circuits(program, (_trim(circuit, ends),))


def _with_circuits(program: Program, circuits: tuple[Circuit, ...]) -> Program:
    used = {symbol for circuit in circuits for symbol in circuit.symbols}
    late_angles = tuple(late for late in program.late_angles if late.name in used)
    return replace(program, circuits=circuits, late_angles=late_angles)


def _trim(circuit: Circuit, ends: Sequence[bool] = ()) -> Circuit:
    if circuit.width == 1:
        gates = list(circuit.gates)
        while gates and _about_z(gates[-1]):
            gates.pop()
        while gates and _about_z(gates[0]):
            gates.pop(0)
        return Circuit(tuple(gates))
    everywhere = [True] * circuit.width
    gates = _without_end(circuit.gates, ends or everywhere, couplings=False)
    gates = _without_end(gates[::-1], everywhere, couplings=False)
    return replace(circuit, gates=tuple(gates[::-1]))


def _without_idle(circuit: Circuit) -> Circuit:
    gates = _without_start(circuit.gates, circuit.width)
    return replace(
        circuit, gates=tuple(_without_end(gates, [True] * circuit.width, couplings=True))
    )


def _without_end(gates: Sequence[Gate], ends: Sequence[bool], *, couplings: bool) -> list[Gate]:
    """The gates without rotations about z after which a qubit meets only diagonal gates.

    A qubit that is open at the end stays so, seen from there, until a gate does not commute with
    its Z, up to sign.
    With `couplings`, drops cz between open qubits instead. Read backwards, the same holds of |0>.
    """
    is_open = list(ends)
    kept: list[Gate] = []
    for gate in reversed(gates):
        if not gate.is_coupling:
            (qubit,) = gate.qubits
            if not _about_z(gate):
                is_open[qubit] = False
            elif is_open[qubit] and not couplings:
                continue
        elif gate.name != "cz":
            is_open[gate.qubits[1]] = False
        elif couplings and all(is_open[qubit] for qubit in gate.qubits):
            continue
        kept.append(gate)
    return kept[::-1]


def _without_start(gates: Sequence[Gate], width: int) -> list[Gate]:
    """The gates without couplings that a qubit in |0> makes the identity."""
    is_zero = [True] * width
    kept = []
    for gate in gates:
        if not gate.is_coupling:
            (qubit,) = gate.qubits
            is_zero[qubit] &= _about_z(gate)
        elif gate.name == "cz":
            if any(is_zero[qubit] for qubit in gate.qubits):
                continue
        elif gate.name == "cx" and is_zero[gate.qubits[0]]:
            continue
        else:
            for qubit in gate.qubits if gate.name == "ecr" else gate.qubits[1:]:
                is_zero[qubit] = False
        kept.append(gate)
    return kept


def _about_z(gate: Gate) -> bool:
    return all(axis == "z" for axis, _ in gate.rotations)
