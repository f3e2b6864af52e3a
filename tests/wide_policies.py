"""A policy of circuits of several qubits, and its expectations without noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from wide import operator

from qcompile.ir import Circuit, Program
from qcompile.policy import Policy, load_policy

LAYER = [["ry", "x0", 0], ["ry", "x1", 1], ["ry", "x2", 2], ["cz", 0, 1], ["cz", 1, 2]]
GATES = [*LAYER, ["ry", "theta0", 0], ["rx", "theta1", 1], ["ry", "x3", 2], *LAYER, ["ry", 1.0, 1]]


def policy() -> Policy:
    """A policy of CartPole that reads products of Z, with a circuit of one qubit beside."""
    shipped = load_policy("cartpole")
    assert isinstance(shipped, Policy)
    circuits = [Circuit.of(GATES, 3), Circuit.parse("ry(x2)")]
    program = replace(
        Program.of(circuits, 4, 2), observables=((0, 1), (3,), (2,), (0, 1, 2), (1, 2))
    )
    weights = np.array([[1.0, 2.0, -1.0, 0.5, 0.3], [-1.0, -2.0, 1.0, -0.5, -0.3]])
    encoder = replace(shipped.encoder, feature=np.arange(4), scale=np.ones(4))
    return replace(
        shipped, name="ring", program=program, theta=np.array([0.3, -0.8]),
        weights=weights, bias=np.zeros(2), reuse=1, encoder=encoder,
    )  # fmt: skip


PAIR = {
    "format": "qcompile-policy-2",
    "name": "pair",
    "environment": "CartPole-v1",
    "encoder": {"function": "arctan", "feature": [2, 3], "scale": [4, 1]},
    "circuits": [
        {
            "qubits": 2,
            "gates": [
                ["ry", "x0+pi/2", 0],
                ["ry", "x1", 1],
                ["cz", 0, 1],
                ["ry", "theta0", 1],
            ],
        }
    ],
    "observables": [[0], [0, 1]],
    "theta": [1.5708],
    "weights": [[4, 4], [-4, -4]],
    "bias": [0, 0],
}
"""A policy file that balances the pole."""
OBSERVATIONS = np.random.default_rng(3).normal(size=(4, 4))


def ideal() -> np.ndarray:
    """<O> of all observables, from Qiskit's unitaries."""
    chosen, rows = policy(), []
    program = chosen.program
    for x in chosen.encode(OBSERVATIONS):
        values = {f"x{i}": v for i, v in enumerate(x)} | {"theta0": 0.3, "theta1": -0.8}
        row = []
        for observable in program.measured:
            circuit = max(i for i, first in enumerate(program.first_bits) if first <= observable[0])
            p = np.abs(operator(program.circuits[circuit], values)[:, 0]) ** 2
            shifts = [bit - program.first_bits[circuit] for bit in observable]
            ones = (np.arange(len(p))[:, None] >> shifts) & 1
            row.append(p @ (-1.0) ** ones.sum(axis=1))
        rows.append(row)
    return np.array(rows)
