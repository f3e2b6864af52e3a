"""Layers against the unitaries of the circuits that they are made of."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from wide import ANY, SYMBOLS, operator, random_circuit

from qcompile.ir import Circuit, Gate
from qcompile.states.layers import Layer, layers

INPUTS = ("x0", "x1")


def circuit_of(found: list[Layer], width: int) -> Circuit:
    """The gates of layers in order."""
    gates = []
    for layer in found:
        gates += [Gate("rz", angle, (qubit,)) for qubit, angle in layer.phases.items()]
        for qubit, run in layer.runs.items():
            gates += [Gate(f"r{axis}", angle, (qubit,)) for axis, angle in run]
        gates += layer.couplings
    return Circuit(tuple(gates), width)


@pytest.mark.parametrize("seed", range(20))
def test_layers_keep_the_distribution_and_the_inputs_apart(seed: int) -> None:
    rng = np.random.default_rng(seed)
    circuit = random_circuit(rng, ANY, int(rng.integers(2, 5)))
    found = layers(circuit.gates, circuit.width, INPUTS)
    values = dict(zip(SYMBOLS, rng.uniform(-3, 3, 4).tolist(), strict=True))
    ours, expected = (
        np.abs(operator(c, values)[:, 0]) ** 2 for c in (circuit_of(found, circuit.width), circuit)
    )
    np.testing.assert_allclose(ours, expected, atol=1e-12)
    for layer in found:
        assert all(set(angle.symbols) <= set(INPUTS) for angle in layer.phases.values())
        for run in layer.runs.values():
            assert not any(set(angle.symbols) & set(INPUTS) for _, angle in run)
            axes = [axis for axis, _ in run]
            assert all(a != b for a, b in pairwise(axes))


def test_a_layer_of_an_ansatz_is_one_layer() -> None:
    """rx(x), then ry and rz with trained angles: the fixed rotations join the trained ones."""
    block = [["rx", "x0", 0], ["ry", "theta0", 0], ["rz", "theta1", 0]]
    gates = [*block, ["rx", "x1", 1], ["ry", "theta0", 1], ["rz", "theta1", 1], ["cz", 0, 1]]
    found = layers(Circuit.of(gates * 3, 2).gates, 2, INPUTS)
    assert [(len(layer.phases), len(layer.runs)) for layer in found] == [
        *((0, 2), (2, 2)),  # the first phases are between quarter turns; so are the others,
        *((0, 2), (2, 2)),  # which follow couplings
        *((0, 2), (2, 2)),
    ]
    assert [layer.is_fixed for layer in found] == [True, False] * 3


def test_a_circuit_without_gates_is_one_empty_layer() -> None:
    assert layers((), 3, INPUTS) == [Layer()]


def test_z_rotations_before_the_measurement_are_left_out() -> None:
    gates = [["ry", "x0", 0], ["cz", 0, 1], ["rz", "x0", 0], ["rz", "theta0", 1], ["s", 1]]
    (first, second) = layers(Circuit.of(gates, 2).gates, 2, INPUTS)
    assert (first.phases, second.couplings) == ({}, [Gate("cz", None, (0, 1))])
    assert [*second.phases] == [0]
