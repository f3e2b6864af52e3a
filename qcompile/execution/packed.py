"""Executables as circuits for a sampler: each round is one circuit on the whole device.

Source: qiskit.primitives, SamplerV2 and BitArray.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import CircuitShots, CountArray, FloatArray, IntArray
from qcompile.execution.prepared import Prepared
from qcompile.ir import Circuit, Program
from qcompile.passes import Executable

REGISTER = "c"
Couplings = frozenset[tuple[str, int, int]]
"""Couplings by gate, control and target."""


@dataclass(frozen=True)
class PackedRound:
    """A parametrised circuit with the `circuits` of a round of the executable, side by side.

    Bit i of its register is bit `bits[i]` of the source program: where circuits have one qubit, it
    is circuit `circuits[i]`. Qubits gained by routing are not measured. The metadata of the circuit
    have the list "circuits", and for programs with circuits of several qubits the list "bits".
    Parameter k is slot `slots[k]`. If no angle is open, the global phase is the only parameter,
    because some samplers derive the number of observations from parameters. `qubits` is the number
    of qubits in use, `couplings` are those between them.
    """

    circuit: Any
    parameters: tuple[Any, ...]
    circuits: IntArray
    slots: IntArray
    bits: IntArray
    qubits: int
    couplings: Couplings

    def pub(self, angles: FloatArray) -> tuple[Any, dict[tuple[Any, ...], FloatArray]]:
        """The circuit and its values (B, parameters), for angles (B, slots)."""
        values = angles[:, self.slots] if self.slots.size else np.zeros((len(angles), 1))
        return self.circuit, {self.parameters: values}


class PackedExecutable(Prepared):
    """An executable whose rounds are circuits for a sampler."""

    @cached_property
    def rounds(self) -> list[PackedRound]:
        """The rounds, packed when they are first needed."""
        return [pack_round(self.executable, k) for k in range(self.executable.round_count)]


def pack_round(executable: Executable, index: int) -> PackedRound:
    """Round `index` of the executable as one circuit on all qubits of its device.

    The ideal device has as many qubits as the executable uses.
    """
    from qiskit.circuit import ClassicalRegister, Parameter, QuantumCircuit, QuantumRegister

    template, source, native = executable.template(), executable.source, executable.native
    circuits = np.flatnonzero(executable.rounds == index)
    bits = np.flatnonzero(np.isin(np.repeat(np.arange(len(source)), source.widths), circuits))
    chosen = np.isin(executable.slot_circuits[executable.open_slots], circuits)
    names = [template.inputs[k] for k in np.flatnonzero(chosen)]
    parameters = {name: Parameter(name) for name in names}
    packed = QuantumCircuit(
        QuantumRegister(len(executable.device.qubits) or native.bits, "q"),
        ClassicalRegister(len(bits), REGISTER),
        metadata={"circuits": circuits.tolist()},
    )
    if source.is_wide:
        packed.metadata["bits"] = bits.tolist()
    first_bits, widths = native.first_bits, native.widths
    couplings: set[tuple[str, int, int]] = set()
    for circuit in circuits.tolist():
        first, width = first_bits[circuit], widths[circuit]
        qubits = executable.qubits[first : first + width].tolist()
        _append(packed, template.circuits[circuit], qubits, parameters)
        couplings |= _couplings(native.circuits[circuit], qubits)
    packed.measure(executable.bit_qubits[bits].tolist(), range(len(bits)))
    if not parameters:
        packed.global_phase = parameters["phase"] = Parameter("phase")
    return PackedRound(
        packed,
        tuple(parameters.values()),
        circuits,
        executable.open_slots[chosen],
        bits,
        sum(widths[circuit] for circuit in circuits),
        frozenset(couplings),
    )


def _couplings(circuit: Circuit, qubits: Sequence[int]) -> set[tuple[str, int, int]]:
    if circuit.width == 1:
        return set()
    found = (gate for gate in circuit.gates if gate.is_coupling)
    return {(gate.name, qubits[gate.qubits[0]], qubits[gate.qubits[1]]) for gate in found}


def _append(packed: Any, circuit: Circuit, qubits: list[int], parameters: dict[str, Any]) -> None:
    for gate in circuit.gates:
        angles = []
        if gate.angle is not None:
            open_slot = not gate.angle.is_constant
            angles = [parameters[gate.angle.symbols[0]] if open_slot else gate.angle.constant]
        getattr(packed, gate.name)(*angles, *(qubits[qubit] for qubit in gate.qubits))


def count_odd(
    program: Program,
    rounds: Sequence[PackedRound],
    bits: Sequence[NDArray[np.uint8]],
    shots: CircuitShots,
) -> CountArray:
    """The shots with odd parity of each observable of the program, (B, observables).

    `bits` are the packed bits of each of its rounds, (B, shots, bytes). Of each circuit the first
    `shots` are counted. The parity of one bit alone is odd where it is 1.
    """
    odd = np.zeros((len(bits[0]), len(program.measured)), dtype=np.int64)
    for packed, of_round in zip(rounds, bits, strict=True):
        if program.has_products:
            _count_products(program, packed, of_round, shots, odd)
        else:
            counted = shots[packed.circuits] if isinstance(shots, np.ndarray) else None
            odd[:, packed.circuits] = ones_of_bits(of_round, len(packed.circuits), counted)
    return odd


def _count_products(
    program: Program,
    packed: PackedRound,
    bits: NDArray[np.uint8],
    shots: CircuitShots,
    odd: CountArray,
) -> None:
    """Write the counts of the observables of a round into their columns of `odd`."""
    place_of = {bit: place for place, bit in enumerate(packed.bits.tolist())}
    for number, (circuit, observable) in enumerate(
        zip(program.owners, program.measured, strict=True)
    ):
        if observable[0] not in place_of:
            continue
        mask = np.zeros(8 * bits.shape[-1], dtype=np.uint8)
        mask[[-1 - place_of[bit] for bit in observable]] = 1  # bit 0 comes last
        counted = shots[circuit] if isinstance(shots, np.ndarray) else shots
        found = np.bitwise_xor.reduce(bits[:, :counted] & np.packbits(mask), axis=-1)
        odd[:, number] = (np.bitwise_count(found) & 1).sum(axis=-1, dtype=np.int64)


def ones_of_bits(
    packed: NDArray[np.uint8], width: int, counted: CountArray | None = None
) -> CountArray:
    """The number of shots in which each bit is 1, (..., width), of packed bits (..., shots, bytes).

    For each bit the first `counted` (width,) shots are counted, by default all.
    """
    bits = np.unpackbits(packed, axis=-1)[..., : -width - 1 : -1]  # bit 0 comes last
    if counted is not None:
        bits &= np.arange(bits.shape[-2])[:, None] < counted
    return np.asarray(bits.sum(axis=-2, dtype=np.int64))
