"""Native circuits of several perfect qubits, as statevectors, for whole batches.

With 2**w numbers a row they take far less time than Pauli vectors, which noise needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from qcompile.arrays import ComplexArray, FloatArray
from qcompile.ir import Circuit, Gate
from qcompile.states.couplings import unitary
from qcompile.states.parities import signed_sums
from qcompile.states.shape import CHUNK, RunPlace, Shape


class IdealBlocks:
    """Native circuits of one shape, whose gates differ only in their angles, without noise."""

    def __init__(self, circuits: Sequence[Circuit]):
        self._shape = shape = Shape(circuits[0])
        self._name = f"{len(circuits)} circuits on {shape.width} qubits"
        fixed = [[*_between_slots(shape.gates[run.number])] for run in shape.runs]
        most = max(map(len, fixed))
        padded = [[*matrices, *[np.eye(2)] * (most - len(matrices))] for matrices in fixed]
        self._fixed = np.array(padded, dtype=complex).transpose(1, 0, 2, 3)  # position, run
        count = sum(len(run.slots) for run in shape.runs)
        self._columns = np.full((most - 1, len(shape.runs)), count)
        for run in shape.runs:
            self._columns[: len(run.slots), run.number] = run.slots

    def __repr__(self) -> str:
        return f"IdealBlocks({self._name})"

    def parities(self, cos: FloatArray, sin: FloatArray) -> FloatArray:
        """The expectations of all products of Z, (B, circuits, 2**width), as of `NoisyBlocks`."""
        rows, circuits, slots = cos.shape
        phases = (cos + 1j * sin).reshape(rows * circuits, slots)
        height, size = max(1, CHUNK >> self._shape.width), 2**self._shape.width
        chunks = (phases[start : start + height] for start in range(0, len(phases), height))
        found = [self._parities(chunk) for chunk in chunks]
        return np.concatenate([*found, np.empty((0, size))]).reshape(rows, circuits, size)

    def _parities(self, phases: ComplexArray) -> FloatArray:
        """The parities, (rows, 2**width), for exp(i angle) of the slots (rows, slots)."""
        matrices, width = self._matrices(phases), self._shape.width
        state = np.zeros((2,) * width + (len(phases),), dtype=complex)
        state[(0,) * width] = 1.0
        for part in self._shape.parts:
            if isinstance(part, RunPlace):
                state = _turned(matrices[part.number], state, part.qubit)
            else:
                state = _coupled(part.gate, state)
        p = (state.real**2 + state.imag**2).reshape(-1, len(phases))
        return signed_sums(p.T)

    def _matrices(self, phases: ComplexArray) -> ComplexArray:
        """The matrix of each run, (runs, 2, 2, rows): fixed ones and rotations in turn."""
        phases = np.pad(phases, ((0, 0), (0, 1)), constant_values=1.0).T
        matrices = np.repeat(self._fixed[0][..., None], phases.shape[1], axis=-1)
        for fixed, columns in zip(self._fixed[1:], self._columns, strict=True):
            matrices[:, 1] *= phases[columns][:, None]  # a rotation about z, up to global phase
            flat = matrices.reshape(len(matrices), 2, -1)
            matrices = np.matmul(fixed, flat).reshape(matrices.shape)
        return matrices


def _between_slots(gates: Iterable[Gate]) -> Iterator[ComplexArray]:
    """The fixed matrices before, between and after the slots of a run, (2, 2).

    A slot is Rz(a), up to global phase; Rx(a) is one between two fixed rotations about y.
    """
    current = np.eye(2, dtype=complex)
    for gate in gates:
        if gate.angle is None:
            for axis, angle in gate.rotations:
                current = _rotation(axis, angle.constant) @ current
            continue
        turned = gate.name == "rx"
        yield _rotation("y", -math.pi / 2) @ current if turned else current
        current = _rotation("y", math.pi / 2) if turned else np.eye(2, dtype=complex)
    yield current


def _rotation(axis: str, angle: float) -> ComplexArray:
    cos, sin = math.cos(angle / 2), math.sin(angle / 2)
    if axis == "z":
        return np.diag([cos - 1j * sin, cos + 1j * sin])
    return np.array([[cos, -sin], [sin, cos]], dtype=complex)


def _turned(matrix: ComplexArray, state: ComplexArray, qubit: int) -> ComplexArray:
    """A matrix (2, 2, rows) on one axis of the states (2, ..., 2, rows)."""
    before = np.moveaxis(state, qubit, 0)
    after = [row[0] * before[0] + row[1] * before[1] for row in matrix]
    return np.stack(after, axis=qubit)


def _coupled(gate: Gate, state: ComplexArray) -> ComplexArray:
    matrix = unitary(gate.name).reshape(2, 2, 2, 2)
    return np.moveaxis(np.tensordot(matrix, state, axes=((2, 3), gate.qubits)), (0, 1), gate.qubits)
