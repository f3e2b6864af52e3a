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
from qcompile.ir import Circuit
from qcompile.passes import Executable

REGISTER = "c"


@dataclass(frozen=True)
class PackedRound:
    """A parametrised circuit; bit i of its register is circuit `circuits[i]` of the executable.

    The metadata of the circuit also have this list, as "circuits". Parameter k is slot `slots[k]`.
    If no angle is open, the global phase is the only parameter, because some samplers derive the
    number of observations from parameters.
    """

    circuit: Any
    parameters: tuple[Any, ...]
    circuits: IntArray
    slots: IntArray

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

    template = executable.template()
    circuits = np.flatnonzero(executable.rounds == index)
    chosen = np.isin(executable.slot_circuits[executable.open_slots], circuits)
    names = [template.inputs[k] for k in np.flatnonzero(chosen)]
    parameters = {name: Parameter(name) for name in names}
    packed = QuantumCircuit(
        QuantumRegister(len(executable.device.qubits) or len(executable.native), "q"),
        ClassicalRegister(len(circuits), REGISTER),
        metadata={"circuits": circuits.tolist()},
    )
    qubits = executable.qubits[circuits].tolist()
    for circuit, qubit in zip(circuits, qubits, strict=True):
        _append(packed, template.circuits[circuit], qubit, parameters)
    packed.measure(qubits, range(len(qubits)))
    if not parameters:
        packed.global_phase = parameters["phase"] = Parameter("phase")
    slots = executable.open_slots[chosen]
    return PackedRound(packed, tuple(parameters.values()), circuits, slots)


def _append(packed: Any, circuit: Circuit, qubit: int, parameters: dict[str, Any]) -> None:
    for gate in circuit.gates:
        angles = []
        if gate.angle is not None:
            open_slot = not gate.angle.is_constant
            angles = [parameters[gate.angle.symbols[0]] if open_slot else gate.angle.constant]
        getattr(packed, gate.name)(*angles, qubit)


def count_ones(
    rounds: Sequence[PackedRound],
    bits: Sequence[NDArray[np.uint8]],
    circuits: IntArray,
    shots: CircuitShots,
) -> CountArray:
    """The ones of `circuits`, (B, circuits), from the packed bits of rounds with just these.

    Bits are (B, shots, bytes) for each round; `circuits` is sorted. For each circuit of the
    executable the first `shots` are counted.
    """
    ones = np.zeros((len(bits[0]), len(circuits)), dtype=np.int64)
    for packed, of_round in zip(rounds, bits, strict=True):
        width = len(packed.circuits)
        counted = shots[packed.circuits] if isinstance(shots, np.ndarray) else None
        ones[:, np.searchsorted(circuits, packed.circuits)] = ones_of_bits(of_round, width, counted)
    return ones


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
