"""Executables as circuits for a sampler: one for each round, packed side by side on the device.

Source: qiskit.primitives, SamplerV2 and BitArray.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.arrays import CountArray, FloatArray, IntArray
from qcompile.ir import Circuit
from qcompile.passes import Executable

REGISTER = "c"


@dataclass(frozen=True)
class PackedRound:
    """A parametrised circuit; bit i of its register is circuit `circuits[i]` of the executable.

    Parameter k is slot `slots[k]` of circuit `owners[k]`. Where no angle is open the global phase
    is the only parameter: some samplers take the number of observations from parameters alone.
    """

    circuit: Any
    parameters: tuple[Any, ...]
    circuits: IntArray
    owners: IntArray
    slots: IntArray

    def pub(self, angles: FloatArray) -> tuple[Any, dict[tuple[Any, ...], FloatArray]]:
        """The circuit and its values (B, parameters), of angles (B, circuits, slots)."""
        values = angles[:, self.owners, self.slots]
        if not self.owners.size:
            values = np.zeros((len(angles), 1))
        return self.circuit, {self.parameters: values}


def pack_round(executable: Executable, index: int) -> PackedRound:
    """Round `index` of the executable as one circuit on all qubits of its device.

    The ideal device has as many as the executable uses.
    """
    from qiskit.circuit import ClassicalRegister, Parameter, QuantumCircuit, QuantumRegister

    template = executable.template()
    circuits = np.flatnonzero(executable.rounds == index)
    places = [place for place in executable.open_slots if place[0] in circuits]
    parameters = {name: Parameter(name) for name in (f"a{i}_{k}" for i, k in places)}
    built = QuantumCircuit(
        QuantumRegister(len(executable.device.qubits) or len(executable.native), "q"),
        ClassicalRegister(len(circuits), REGISTER),
    )
    qubits = executable.qubits[circuits].tolist()
    for circuit, qubit in zip(circuits, qubits, strict=True):
        _append(built, template.circuits[circuit], qubit, parameters)
    built.measure(qubits, range(len(qubits)))
    if not places:
        built.global_phase = parameters["phase"] = Parameter("phase")
    owners, slots = np.array(places, dtype=np.intp).reshape(-1, 2).T
    return PackedRound(built, tuple(parameters.values()), circuits, owners, slots)


def _append(built: Any, circuit: Circuit, qubit: int, parameters: dict[str, Any]) -> None:
    for gate in circuit.gates:
        angles = []
        if gate.angle is not None:
            open_slot = not gate.angle.is_constant
            angles = [parameters[gate.angle.symbols[0]] if open_slot else gate.angle.constant]
        getattr(built, gate.name)(*angles, qubit)


def count_ones(bits: NDArray[np.uint8], circuits: int) -> CountArray:
    """Ones of each bit, (B, circuits), of packed bits (B, shots, bytes): bit 0 comes last."""
    unpacked = np.unpackbits(bits, axis=-1)[..., : -circuits - 1 : -1]
    return np.asarray(unpacked.sum(axis=1, dtype=np.int64))
