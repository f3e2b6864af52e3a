"""A device's noise as affine maps of the Bloch vector, and noisy expectations for whole batches.

After every gate with a calibration Aer's model puts a depolarising channel, then thermal
relaxation; together they have the gate error of the calibration. Both map the Bloch vector
r to A r + t, so a noisy circuit with K rotations is K rotations about z between fixed maps.
Source: qiskit_aer.noise.device.models (basic_device_gate_errors), temperature 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.device import Device, Qubit, left_after
from qcompile.ir import Circuit, Gate
from qcompile.passes import Executable

_EYE = np.eye(4)


def noise_after(gate: str, qubit: Qubit | None) -> FloatArray:
    """The map of the noise that follows `gate` on `qubit`, (4, 4); None is a perfect qubit."""
    if qubit is None:
        return _EYE
    across, along, added = left_after(gate, qubit)
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
    """The circuits of an executable with the noise of its device, evaluated for whole batches."""

    def __init__(self, executable: Executable):
        device, slots = executable.device, max(executable.slots, 1)
        circuits = executable.native.circuits
        fixed = np.empty((slots + 1, len(circuits), 4, 4))
        for index, circuit in enumerate(circuits):
            qubit = physical_qubit(device, int(executable.qubits[index]))
            maps = list(_maps_between_slots(circuit, qubit))
            fixed[:, index] = [*maps, *[_EYE] * (slots + 1 - len(maps))]
        rows = [readout_row(physical_qubit(device, int(q))) for q in executable.qubits]
        self._start = fixed[0, :, 1:, 0] + fixed[0, :, 1:, 3]
        self._between = fixed[1:-1]
        end = np.einsum("ci,cij->cj", np.reshape(rows, (-1, 4)), fixed[-1])
        self._end = end.T.copy()
        # Nothing before the first slot depends on angles: a single slot is a response curve.
        self._response = self._curve(*self._start.T) if slots == 1 else None

    def expectation(self, angles: FloatArray) -> FloatArray:
        """The measured `<Z>` for the angles (B, circuits, slots) of `Executable.bind_slots`.

        (B, circuits), exact: no shot noise. With one slot it is the response curve of the qubit,
        b + c cos(a) + s sin(a).
        """
        return np.asarray(1.0 - 2.0 * self.p_one(np.cos(angles), np.sin(angles)))

    def p_one(self, cos: FloatArray, sin: FloatArray) -> FloatArray:
        """P(1) of each circuit for the cosines and sines of its angles, as `bind_turns` gives them.

        Arrays of (B, circuits, slots) to (B, circuits), in [0, 1] up to rounding.
        """
        if self._response is not None:
            b, c, s = self._response
            return np.asarray(b + c * cos[:, :, 0] + s * sin[:, :, 0])
        r_x, r_y, r_z = self._start.T
        for slot, fixed in enumerate(self._between):
            cos_k, sin_k = cos[:, :, slot], sin[:, :, slot]
            r_x, r_y = r_x * cos_k - r_y * sin_k, r_x * sin_k + r_y * cos_k
            r_x, r_y, r_z = (
                fixed[:, i, 0] + fixed[:, i, 1] * r_x + fixed[:, i, 2] * r_y + fixed[:, i, 3] * r_z
                for i in (1, 2, 3)
            )
        b, c, s = self._curve(r_x, r_y, r_z)
        return np.asarray(b + c * cos[:, :, -1] + s * sin[:, :, -1])

    def _curve(
        self, r_x: FloatArray, r_y: FloatArray, r_z: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """b, c, s of P(1) as a function of the last angle, after a Bloch vector."""
        b, e_x, e_y, e_z = self._end
        z = b + e_z * r_z, e_x * r_x + e_y * r_y, e_y * r_x - e_x * r_y
        return (1.0 - z[0]) / 2, -z[1] / 2, -z[2] / 2


def physical_qubit(device: Device, index: int) -> Qubit | None:
    """The qubit of a device, or None for a perfect one."""
    return None if device.is_ideal else device.qubits[index]


def _maps_between_slots(circuit: Circuit, qubit: Qubit | None) -> Iterator[FloatArray]:
    """The fixed maps before, between and after the slots of a native circuit.

    A slot is Rz(a). Rx(a) = Ry(pi/2) Rz(a) Ry(-pi/2): turns of the frame, without noise.
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
