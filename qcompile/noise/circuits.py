"""Circuits with the noise of a device, as affine maps on the Bloch vector, for whole batches.

Noise maps the Bloch vector r to A r + t, so a noisy circuit with K rotations is K rotations about
z between fixed maps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from qcompile.arrays import FloatArray, IntArray
from qcompile.device import Device, Qubit
from qcompile.ir import Circuit, Gate
from qcompile.native import slots
from qcompile.noise.channels import Channel, channel_after

_EYE = np.eye(4)


def noise_after(gate: str, qubit: Qubit | None) -> FloatArray:
    """The map of the noise after `gate` on `qubit`, (4, 4); None is a perfect qubit."""
    return channel_map(channel_after(gate, qubit))


def channel_map(channel: Channel) -> FloatArray:
    """The map of a channel, (4, 4)."""
    across, along, added = channel
    noise = np.diag([1.0, across, across, along])
    noise[3, 0] = added
    return noise


def readout_row(qubit: Qubit | None) -> FloatArray:
    """(4,): the measured `<Z>` is this row times (1, r_x, r_y, r_z)."""
    if qubit is None:
        return np.array([0.0, 0.0, 0.0, 1.0])
    return np.array([qubit.p01 - qubit.p10, 0.0, 0.0, qubit.contrast])


def rotation_map(axis: str, angle: float) -> FloatArray:
    """The map of Rx, Ry or Rz by `angle`, (4, 4)."""
    cos, sin = math.cos(angle), math.sin(angle)
    first, second = {"x": (2, 3), "y": (3, 1), "z": (1, 2)}[axis]
    rotation = np.eye(4)
    rotation[first, first] = rotation[second, second] = cos
    rotation[first, second], rotation[second, first] = -sin, sin
    return rotation


class NoisyCircuits:
    """Native circuits on physical `qubits` (circuits,) of a device, evaluated for whole batches.

    Angles are flat: one column for each of the `native.slots`.
    """

    def __init__(self, circuits: Sequence[Circuit], device: Device, qubits: IntArray):
        self._device = device
        owners, positions = slots(circuits)
        most = int(positions.max(initial=0)) + 1
        self._columns = np.full((most, len(circuits)), len(owners))  # beyond the last: no slot
        self._columns[positions, owners] = np.arange(len(owners))
        self._uneven = most * len(circuits) > len(owners)
        placed = [None if device.is_ideal else device.qubits[q] for q in qubits.tolist()]
        fixed = np.empty((most + 1, len(circuits), 4, 4))
        for index, circuit in enumerate(circuits):
            maps = list(maps_between_slots(circuit, placed[index]))
            fixed[:, index] = [*maps, *[_EYE] * (most + 1 - len(maps))]
        rows = np.reshape([readout_row(qubit) for qubit in placed], (-1, 4))
        self._start = fixed[0, :, 1:, 0] + fixed[0, :, 1:, 3]
        self._between = fixed[1:-1]
        self._end = np.einsum("ci,cij->cj", rows, fixed[-1]).T.copy()
        # Nothing before the first slot depends on angles: a single slot is a response curve.
        self._response = self._curve(*self._start.T) if most == 1 else None

    def __repr__(self) -> str:
        return f"NoisyCircuits({self._columns.shape[1]} circuits on {self._device.name})"

    def expectation(self, angles: FloatArray) -> FloatArray:
        """The measured `<Z>`, (B, circuits), for angles (B, slots) from `Executable.bind`.

        It is exact, without shot noise. With one slot it is the response curve of the qubit,
        b + c cos(a) + s sin(a).
        """
        return np.asarray(1.0 - 2.0 * self.p_one(np.cos(angles), np.sin(angles)))

    def p_one(self, cos: FloatArray, sin: FloatArray) -> FloatArray:
        """P(1) of each circuit, (B, circuits), in [0, 1] up to rounding.

        `cos` and `sin` (B, slots) are those of the angles, from `Executable.bind_turns`.
        """
        if self._response is not None:
            b, c, s = self._response
            return np.asarray(b + c * cos + s * sin)
        if self._uneven:  # a slot that a circuit lacks turns by nothing
            cos = np.pad(cos, ((0, 0), (0, 1)), constant_values=1.0)
            sin = np.pad(sin, ((0, 0), (0, 1)))
        r_x, r_y, r_z = self._start.T
        for columns, fixed in zip(self._columns[:-1], self._between, strict=True):
            cos_k, sin_k = cos[:, columns], sin[:, columns]
            r_x, r_y = r_x * cos_k - r_y * sin_k, r_x * sin_k + r_y * cos_k
            r_x, r_y, r_z = (
                fixed[:, i, 0] + fixed[:, i, 1] * r_x + fixed[:, i, 2] * r_y + fixed[:, i, 3] * r_z
                for i in (1, 2, 3)
            )
        b, c, s = self._curve(r_x, r_y, r_z)
        last = self._columns[-1]
        return np.asarray(b + c * cos[:, last] + s * sin[:, last])

    def _curve(
        self, r_x: FloatArray, r_y: FloatArray, r_z: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """b, c, s of P(1) as a function of the last angle, for a Bloch vector before it."""
        b, e_x, e_y, e_z = self._end
        z = b + e_z * r_z, e_x * r_x + e_y * r_y, e_y * r_x - e_x * r_y
        return (1.0 - z[0]) / 2, -z[1] / 2, -z[2] / 2


def maps_between_slots(circuit: Circuit, qubit: Qubit | None) -> Iterator[FloatArray]:
    """The fixed maps before, between and after the slots of a native circuit.

    A slot is Rz(a). Rx(a) = Ry(pi/2) Rz(a) Ry(-pi/2), where the Ry are noiseless frame changes.
    """
    current = _EYE
    for gate in circuit.gates:
        if gate.name == "rz":
            yield current
            current = noise_after("rz", qubit)
        elif gate.name == "rx":
            yield rotation_map("y", -math.pi / 2) @ current
            current = noise_after("rx", qubit) @ rotation_map("y", math.pi / 2)
        else:
            current = noise_after(gate.name, qubit) @ _fixed_map(gate) @ current
    yield current


def _fixed_map(gate: Gate) -> FloatArray:
    result = _EYE
    for axis, angle in gate.rotations:
        result = rotation_map(axis, angle.constant) @ result
    return result
