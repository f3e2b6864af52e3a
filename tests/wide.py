"""Random circuits of several qubits, and their unitaries by Qiskit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from qiskit import QuantumCircuit
from qiskit.quantum_info import Operator

from qcompile.ir import COUPLINGS, FIXED_GATES, ROTATION_GATES, Angle, Circuit, Gate

ANY = (*FIXED_GATES, *ROTATION_GATES)
SYMBOLS = ("x0", "x1", "theta0", "theta1")
SPECIAL = (0, math.pi / 2, -math.pi / 2, math.pi, 1e-9)


def operator(circuit: Circuit, values: Mapping[str, float]) -> np.ndarray:
    """The circuit's unitary, built gate by gate with Qiskit."""
    built = QuantumCircuit(circuit.width)
    for gate in circuit.gates:
        angle = gate.angle
        words = () if angle is None else (value(angle, values),)
        getattr(built, gate.name)(*words, *gate.qubits)
    return Operator(built).data


def value(angle: Angle, values: Mapping[str, float]) -> float:
    return angle.constant + sum(c * values[s] for s, c in angle.terms)


def random_circuit(rng: np.random.Generator, gates: Sequence[str], width: int) -> Circuit:
    chosen = []
    for _ in range(rng.integers(0, 6 * width + 1)):
        if width > 1 and rng.random() < 0.3:
            qubits = tuple(rng.choice(width, 2, replace=False).tolist())
            chosen.append(Gate(str(rng.choice(COUPLINGS)), None, qubits))
            continue
        name = str(rng.choice(gates))
        angle = random_angle(rng) if name in ROTATION_GATES else None
        chosen.append(Gate(name, angle, (int(rng.integers(width)),)))
    return Circuit(tuple(chosen), width)


def random_angle(rng: np.random.Generator) -> Angle:
    angle = Angle.of(float(rng.choice(SPECIAL) if rng.random() < 0.6 else rng.uniform(-4, 4)))
    if rng.random() < 0.6:
        angle += Angle.symbol(str(rng.choice(SYMBOLS))) * float(rng.choice([1.0, -0.5, 0.3]))
    return angle
