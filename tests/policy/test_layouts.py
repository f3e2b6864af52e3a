"""The usual circuits: the paper's closed form, re-uploading, and the device circuit."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from qiskit import QuantumCircuit
from qiskit.quantum_info import Pauli, Statevector

from qcompile.device import load_device
from qcompile.errors import PolicyError
from qcompile.passes import compile
from qcompile.policy.layouts import LAYOUTS, parallel, serial, single
from qcompile.simulate import Simulator

RNG = np.random.default_rng(0)


def test_parallel_is_the_closed_form_of_the_paper() -> None:
    """y = -sin(x) cos(theta) - cos(x)**2 sin(theta), circuit by circuit."""
    program, feature = parallel(4, 2)
    assert feature == [0, 1, 2, 3, 0, 1, 2, 3]
    assert (len(program), len(program.inputs), len(program.parameters)) == (8, 8, 8)
    x, theta = RNG.uniform(-2, 2, (30, 8)), RNG.uniform(-4, 4, 8)
    expected = -np.sin(x) * np.cos(theta) - np.cos(x) ** 2 * np.sin(theta)
    np.testing.assert_allclose(Simulator(program).expectation(x, theta), expected, atol=1e-14)


def test_serial_uploads_a_feature_once_a_layer() -> None:
    features, layers = 3, 2
    program, feature = serial(features, layers)
    assert feature == [0, 1, 2, 0, 1, 2]
    assert len(program) == features
    x, theta = RNG.uniform(-2, 2, (4, 6)), RNG.uniform(-4, 4, 6)
    found = Simulator(program).expectation(x, theta)
    for row in range(len(x)):
        for f in range(features):
            circuit = QuantumCircuit(1)
            circuit.h(0)
            for layer in range(layers):
                index = layer * features + f
                circuit.ry(x[row, index], 0)
                circuit.rz(x[row, index], 0)
                circuit.ry(theta[index], 0)
            expected = Statevector(circuit).expectation_value(Pauli("Z")).real
            assert found[row, f] == pytest.approx(expected, abs=1e-13)


def test_one_layer_is_the_same_in_serial_and_parallel() -> None:
    assert serial(5, 1) == parallel(5, 1)


@pytest.mark.parametrize("layout", [parallel, serial])
@pytest.mark.parametrize("backend", ["ideal", "ibm_lima"])
def test_both_readings_compile_to_three_gates(layout: object, backend: str) -> None:
    program, _ = layout(8, 3)  # type: ignore[operator]
    counts = compile(program, load_device(backend), level=2).gate_counts()
    assert counts == [Counter(sx=2, rz=1)] * len(program)


def test_single_is_the_device_circuit() -> None:
    program, feature = single(4, 2)
    assert feature == [1, 2, 3, 1, 2, 3]
    assert (len(program), len(program.parameters)) == (2, 2)
    x, theta = RNG.uniform(-2, 2, (5, 6)), RNG.uniform(-4, 4, 2)
    found = Simulator(program).expectation(x, theta)
    for row in range(len(x)):
        for copy in range(2):
            circuit = QuantumCircuit(1)
            circuit.h(0)
            circuit.rz(x[row, 3 * copy], 0)
            circuit.ry(x[row, 3 * copy + 1], 0)
            circuit.rz(x[row, 3 * copy + 2], 0)
            circuit.rx(theta[copy], 0)
            expected = Statevector(circuit).expectation_value(Pauli("Z")).real
            assert found[row, copy] == pytest.approx(expected, abs=1e-13)


def test_single_needs_three_features() -> None:
    with pytest.raises(PolicyError, match="needs 3 features; there are 2"):
        single(2, 1)


def test_every_layout_has_a_feature_for_each_input() -> None:
    assert set(LAYOUTS) == {"parallel", "serial", "single"}
    for layout in LAYOUTS.values():
        program, feature = layout(5, 3)
        assert len(feature) == len(program.inputs)
        assert max(feature) == 4
