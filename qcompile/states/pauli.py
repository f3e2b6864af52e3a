"""Circuits of several qubits with the noise of a device, as affine maps on the Pauli vector.

The Pauli vector of w qubits holds the expectation of every product of I, X, Y and Z, 4**w numbers;
with one qubit it is (1, Bloch vector). Gates on one qubit and their noise are 4 x 4 maps on its
axis. A coupling is a signed permutation, its depolarising a factor, and its relaxation a map on
each of its qubits, which joins the next run. So a circuit is runs, whose maps are multiplied before
they meet the state, between permutations.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.device import Device, Qubit
from qcompile.ir import Circuit, Gate
from qcompile.noise.channels import CouplingChannel, channel_after_coupling
from qcompile.noise.circuits import channel_map, maps_between_slots, readout_row
from qcompile.states.couplings import on_pauli_vector
from qcompile.states.shape import CHUNK, CouplingPlace, Shape


class NoisyBlocks:
    """Native circuits of one shape on physical `qubits` (circuits, width) of a device, in batches.

    The shape is everything but angles: names and qubits of all gates. `dtype` is that of the state.
    """

    def __init__(
        self,
        circuits: Sequence[Circuit],
        device: Device,
        qubits: IntArray,
        dtype: Any = np.float64,
    ):
        self._shape, self._dtype = Shape(circuits[0]), dtype
        self._name = f"{len(circuits)} circuits on {self._shape.width} qubits of {device.name}"
        placed = [[device.qubits[q] for q in row] for row in qubits.tolist()]
        channels = [
            [self._channel(part.gate, device, row) for part in self._shape.couplings]
            for row in qubits.tolist()
        ]
        self._moves = [self._move(part, channels) for part in self._shape.couplings]
        maps = [self._maps(row, relaxed) for row, relaxed in zip(placed, channels, strict=True)]
        self._fixed = np.array(maps, dtype=dtype).transpose(2, 1, 0, 3, 4)  # position, run, circuit
        self._columns = self._slot_columns()
        self._entries = self._nonzero_entries()

    def __repr__(self) -> str:
        return f"NoisyBlocks({self._name})"

    def parities(self, cos: FloatArray, sin: FloatArray) -> FloatArray:
        """The measured expectations of all products of Z, (B, circuits, 2**width).

        `cos` and `sin` (B, circuits, slots) are those of the native angles. Number n of the last
        axis is the product over the qubits whose bit is set in n, the first qubit's bit highest;
        number 0 is 1.
        """
        rows, circuits = cos.shape[:2]
        height = max(1, CHUNK // (4**self._shape.width * circuits))
        result = np.empty((rows, circuits, 2**self._shape.width), dtype=self._dtype)
        for start in range(0, rows, height):
            chunk = slice(start, start + height)
            parities = self._evaluate(self._run_maps(cos[chunk], sin[chunk]))
            result[chunk] = parities.reshape(parities.shape[0], circuits, -1).transpose(2, 1, 0)
        return result

    def _channel(self, gate: Gate, device: Device, placed: Sequence[int]) -> CouplingChannel:
        control, target = (placed[qubit] for qubit in gate.qubits)
        calibration = device.coupling_calibrations.get((gate.name, control, target))
        return channel_after_coupling(calibration, (device.qubits[control], device.qubits[target]))

    def _move(
        self, part: CouplingPlace, channels: Sequence[Sequence[CouplingChannel]]
    ) -> tuple[IntArray, FloatArray]:
        """The entries of the Pauli vector that a coupling takes, and their factors, by circuit."""
        moved = on_pauli_vector(part.gate.name, part.gate.qubits, self._shape.width)
        left = np.array([row[part.number].left for row in channels])
        factors = np.where(moved.is_touched[:, None], left, 1.0) * moved.sign[:, None]
        return moved.source, factors.astype(self._dtype)

    def _maps(
        self, placed: Sequence[Qubit], channels: Sequence[CouplingChannel]
    ) -> list[list[FloatArray]]:
        """The fixed maps of every run of a circuit, as many for each as the run with most slots."""
        most = max(len(run.slots) for run in self._shape.runs) + 1
        waiting = [np.eye(4)] * self._shape.width
        maps: list[list[FloatArray]] = [[]] * len(self._shape.runs)
        for part in self._shape.parts:
            if isinstance(part, CouplingPlace):
                for qubit, relaxed in zip(
                    part.gate.qubits, channels[part.number].relaxed, strict=True
                ):
                    waiting[qubit] = channel_map(relaxed)
                continue
            gates = Circuit(self._shape.gates[part.number])
            fixed = list(maps_between_slots(gates, placed[part.qubit]))
            fixed[0], waiting[part.qubit] = fixed[0] @ waiting[part.qubit], np.eye(4)
            maps[part.number] = [*fixed, *[np.eye(4)] * (most - len(fixed))]
        for run in self._shape.last:
            readout = np.zeros((4, 4))
            readout[0, 0], readout[1] = 1.0, readout_row(placed[run.qubit])
            maps[run.number][-1] = readout @ maps[run.number][-1]
        return maps

    def _slot_columns(self) -> IntArray:
        """The slot at each position of each run; the number of slots where there is none."""
        runs = self._shape.runs
        count = sum(len(run.slots) for run in runs)
        columns = np.full((len(self._fixed) - 1, len(runs)), count)
        for run in runs:
            columns[: len(run.slots), run.number] = run.slots
        return columns

    def _nonzero_entries(self) -> list[list[list[int]]]:
        """For each run and row of its map, the columns of entries that are not always 0."""
        turn = np.eye(4, dtype=int)
        turn[1:3, 1:3] = 1
        found = (self._fixed[0] != 0).any(axis=1).astype(int)
        for fixed in self._fixed[1:]:
            found = (fixed != 0).any(axis=1).astype(int) @ (turn @ found)
        return [[np.flatnonzero(row).tolist() for row in entries] for entries in found]

    def _run_maps(self, cos: FloatArray, sin: FloatArray) -> FloatArray:
        """The map of each run, (runs, circuits, 4, 4, B): fixed maps and rotations in turn."""
        rows, circuits = cos.shape[:2]
        cos = np.concatenate([cos, np.ones((rows, circuits, 1))], axis=2, dtype=self._dtype)
        sin = np.concatenate([sin, np.zeros((rows, circuits, 1))], axis=2, dtype=self._dtype)
        maps = np.repeat(self._fixed[0][..., None], rows, axis=-1)
        for fixed, columns in zip(self._fixed[1:], self._columns, strict=True):
            c, s = (turn.T[columns][:, :, None] for turn in (cos, sin))
            r_x, r_y = maps[:, :, 1].copy(), maps[:, :, 2].copy()
            maps[:, :, 1], maps[:, :, 2] = c * r_x - s * r_y, s * r_x + c * r_y
            flat = maps.reshape(*maps.shape[:3], -1)
            maps = np.matmul(fixed, flat).reshape(maps.shape)
        return maps

    def _evaluate(self, maps: FloatArray) -> FloatArray:
        """The parities, (2**width, circuits * B), for the maps of all runs."""
        shape, width = self._shape, self._shape.width
        state = np.ones((1, maps.shape[1] * maps.shape[-1]), dtype=self._dtype)
        for run in shape.first:  # from |0>, whose vector is (1, 0, 0, 1)
            vector = maps[run.number, :, :, 0] + maps[run.number, :, :, 3]
            columns = vector.transpose(1, 0, 2).reshape(1, 4, -1)
            state = (state[:, None] * columns).reshape(-1, state.shape[-1])
        rows = maps.shape[-1]
        for part in shape.middle:
            if isinstance(part, CouplingPlace):
                source, factors = self._moves[part.number]
                state = state.take(source, axis=0)
                by_circuit = state.reshape(len(state), -1, rows)
                by_circuit *= factors[:, :, None]
            else:
                entries = self._entries[part.number]
                state = _on_axis(maps[part.number], entries, state, part.qubit, width)
        for run in shape.last:
            state = _measured(maps[run.number], state, run.qubit, width)
        return state


def _on_axis(
    matrix: FloatArray, entries: list[list[int]], state: FloatArray, qubit: int, width: int
) -> FloatArray:
    """A map (circuits, 4, 4, B) on one axis of the Pauli vectors (4**width, circuits * B)."""
    before = state.reshape(4**qubit, 4, 4 ** (width - qubit - 1), -1)
    columns = matrix.transpose(1, 2, 0, 3).reshape(4, 4, -1)
    after = np.empty_like(before)
    after[:, 0] = before[:, 0]  # a map keeps the trace
    for row in (1, 2, 3):
        total, (first, *others) = after[:, row], entries[row]
        np.multiply(before[:, first], columns[row, first], out=total)
        for column in others:
            total += before[:, column] * columns[row, column]
    return after.reshape(state.shape)


def _measured(matrix: FloatArray, state: FloatArray, qubit: int, width: int) -> FloatArray:
    """The first two rows of a map on one axis: earlier qubits have two components already."""
    before = state.reshape(2**qubit, 4, 4 ** (width - qubit - 1), -1)
    row = matrix[:, 1].transpose(1, 0, 2).reshape(4, -1)
    after = np.empty((before.shape[0], 2, *before.shape[2:]), dtype=state.dtype)
    after[:, 0] = before[:, 0]
    after[:, 1] = before[:, 0] * row[0]
    for column in (1, 2, 3):
        after[:, 1] += before[:, column] * row[column]
    return after.reshape(-1, state.shape[-1])
