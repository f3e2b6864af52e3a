"""The effect of gate noise on a Bloch vector, and on the Pauli vector of two qubits.

After every calibrated gate Aer's model applies a depolarising channel, then thermal relaxation;
together they have the gate error of the calibration.
Source: qiskit_aer.noise.device.models (basic_device_gate_errors), temperature 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from qcompile.device import GateCalibration, Qubit


class Channel(NamedTuple):
    """A channel symmetric about z: r_x and r_y times `across`; r_z times `along`, plus `added`."""

    across: float
    along: float
    added: float


NOISELESS = Channel(1.0, 1.0, 0.0)


def relaxation(qubit: Qubit, length_ns: float) -> Channel:
    """Thermal relaxation over `length_ns`, towards |0>. T2 is cut to 2 T1, the physical limit."""
    t1_ns = 1e3 * qubit.t1_us
    t2_ns = min(1e3 * qubit.t2_us, 2 * t1_ns)
    along, across = math.exp(-length_ns / t1_ns), math.exp(-length_ns / t2_ns)
    return Channel(across, along, 1 - along)


def relaxation_error(qubit: Qubit, length_ns: float) -> float:
    """The average gate error, 1 - fidelity, of thermal relaxation alone."""
    relaxed = relaxation(qubit, length_ns)
    return (3 - relaxed.along - 2 * relaxed.across) / 6


def depolarising(calibration: GateCalibration, qubit: Qubit) -> float:
    """The depolarising probability that, with relaxation, gives the calibrated gate error.

    It is 0 if relaxation alone exceeds the stated error, and at most 4/3.
    """
    error = min(calibration.error, 2 / 3)
    relaxed = relaxation_error(qubit, calibration.length_ns)
    if error <= relaxed:
        return 0.0
    if relaxed >= 0.5:  # nothing but |0> is left, whatever comes before
        return 1.0
    return min(2 * (error - relaxed) / (1 - 2 * relaxed), 4 / 3)


class CouplingChannel(NamedTuple):
    """The noise after a two-qubit gate: Pauli products other than I I times `left`, then a channel
    on each qubit."""

    left: float
    relaxed: tuple[Channel, Channel]


def channel_after_coupling(
    calibration: GateCalibration | None, qubits: Sequence[Qubit | None]
) -> CouplingChannel:
    """The noise after a two-qubit gate on two qubits; without a calibration there is none."""
    if calibration is None:
        return CouplingChannel(1.0, (NOISELESS, NOISELESS))
    first, second = (
        NOISELESS if qubit is None else relaxation(qubit, calibration.length_ns) for qubit in qubits
    )
    # The average gate fidelity of both relaxations, by their process fidelities.
    process = math.prod((1 + 2 * each.across + each.along) / 4 for each in (first, second))
    relaxed, error = 0.8 * (1 - process), min(calibration.error, 0.8)
    lost = 0.0
    if error > relaxed:
        lost = min((error - relaxed) / (0.75 - relaxed), 16 / 15) if relaxed < 0.75 else 1.0
    return CouplingChannel(1 - lost, (first, second))


def channel_after(gate: str, qubit: Qubit | None) -> Channel:
    """The noise after `gate` on `qubit`; None is a perfect qubit."""
    if qubit is None:
        return NOISELESS
    calibration = qubit.gates.get(gate)
    if calibration is None and gate == "id":
        calibration = qubit.gates.get("sx")
    if calibration is None:
        return NOISELESS
    relaxed = relaxation(qubit, calibration.length_ns)
    left = 1 - depolarising(calibration, qubit)
    return Channel(left * relaxed.across, left * relaxed.along, relaxed.added)
