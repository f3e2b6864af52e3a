"""Readout of products of Z undone: exactly with the true errors, and with honest errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import qcompile
from qcompile.errors import CalibrationError
from qcompile.ir import Circuit, Program
from qcompile.mitigation import calibrate
from qcompile.mitigation.products import (
    ProductMitigation,
    product_mitigation,
    with_sub_products,
)

GHZ = Circuit.parse("ry(0.9)@0 cx@0,1 cx@1,2 ry(0.4)@2", 3)
P10, P01 = np.array([0.02, 0.05, 0.01, 0.03]), np.array([0.06, 0.03, 0.09, 0.02])


def program() -> Program:
    circuits = [GHZ, Circuit.parse("ry(1.1)")]
    return replace(Program.of(circuits), observables=((0, 1, 2), (1,), (3,)))


def probabilities() -> np.ndarray:
    """Of the eight outcomes of three qubits, arbitrary."""
    return np.random.default_rng(0).dirichlet(np.ones(8))


def parity(p: np.ndarray, bits: tuple[int, ...]) -> float:
    outcomes = np.indices((2, 2, 2)).reshape(3, 8)
    return float(p @ (-1.0) ** outcomes[list(bits)].sum(axis=0))


def shown(p: np.ndarray) -> np.ndarray:
    """The same probabilities as read out: each bit flipped by its assignment matrix."""
    found = p.reshape(2, 2, 2)
    for axis in range(3):
        matrix = [[1 - P10[axis], P01[axis]], [P10[axis], 1 - P01[axis]]]
        found = np.moveaxis(np.tensordot(matrix, found, (1, axis)), 0, axis)
    return found.ravel()


def mitigation() -> ProductMitigation:
    products = with_sub_products(program()).measured
    zero = np.zeros(4)
    return ProductMitigation(products, 3, P01 - P10, 1 - P01 - P10, zero, zero)


def test_the_products_of_subsets_are_measured_too_and_come_last() -> None:
    products = with_sub_products(program()).measured
    assert products[:3] == ((0, 1, 2), (1,), (3,))
    assert set(products[3:]) == {(0,), (2,), (0, 1), (0, 2), (1, 2)}


def test_true_errors_are_undone_exactly() -> None:
    """Against assignment matrices applied to whole distributions."""
    undo, p = mitigation(), probabilities()
    measured = [parity(shown(p), bits) if max(bits) < 3 else 0.3 for bits in undo.products]
    found = undo.apply(np.array([measured]))[0]
    np.testing.assert_allclose(found[:2], [parity(p, (0, 1, 2)), parity(p, (1,))], atol=1e-12)
    np.testing.assert_allclose(found[2], (0.3 - (P01[3] - P10[3])) / (1 - P01[3] - P10[3]))


def test_the_shot_noise_is_that_of_many_draws() -> None:
    undo, p = mitigation(), probabilities()
    rng, shots = np.random.default_rng(1), 200
    counts = rng.multinomial(shots, shown(p), size=20_000)
    columns = [parity_of_counts(counts, bits) / shots for bits in undo.products if max(bits) < 3]
    z = np.zeros((len(counts), len(undo.products)))
    z[:, [max(bits) < 3 for bits in undo.products]] = np.array(columns).T
    found = undo.unclipped(z)[:, :2].std(axis=0)
    exact = np.array([[parity(shown(p), b) if max(b) < 3 else 0.0 for b in undo.products]])
    told = undo.standard_error(exact, shots)[0, :2]
    np.testing.assert_allclose(told, found, rtol=0.02)


def parity_of_counts(counts: np.ndarray, bits: tuple[int, ...]) -> np.ndarray:
    outcomes = np.indices((2, 2, 2)).reshape(3, 8)
    return counts @ (-1.0) ** outcomes[list(bits)].sum(axis=0)


def test_the_error_of_the_calibration_is_that_of_many_calibrations() -> None:
    p = probabilities()
    undo = replace(mitigation(), variance=np.full(4, 2e-4), covariance=np.full(4, -5e-5))
    exact = np.array([[parity(shown(p), b) if max(b) < 3 else 0.0 for b in undo.products]])
    rng = np.random.default_rng(2)
    noise = rng.multivariate_normal([0, 0], [[2e-4, -5e-5], [-5e-5, 2e-4]], size=(4000, 4))
    found = [
        replace(undo, offset=undo.offset + n[:, 0], contrast=undo.contrast + n[:, 1]).apply(exact)
        for n in noise
    ]
    told = np.sqrt(undo.variances(exact, 10**9)[1][0, :2])
    np.testing.assert_allclose(told, np.std(found, axis=0)[0, :2], rtol=0.06)


def test_on_a_device_only_what_gates_do_is_left() -> None:
    """With the exact calibration of a device that has no gate noise, the ideal values come back."""
    device = qcompile.load_device("fake_lima")
    quiet = [
        {**qubit.model_dump(), "gates": {}, "p10": 0.02 + 0.01 * i, "p01": 0.06 - 0.005 * i}
        for i, qubit in enumerate(device.qubits)
    ]
    couplings = [{**each.model_dump(), "error": 0.0, "length_ns": 0.0} for each in device.couplings]
    values = device.model_dump() | {"qubits": quiet, "couplings": couplings}
    device = qcompile.Device.model_validate(values)
    wide = with_sub_products(program())
    executable = qcompile.compile(wide, device)
    executor = qcompile.OfflineExecutor(device)
    known = calibrate(executor, executable.qubits, None, parts=["readout"])
    z = executor.expectation(executable, np.zeros((1, 0)), np.zeros(0))
    found = product_mitigation(known, executable, 3).apply(z)
    ideal_device = qcompile.load_device("ideal")
    ideal = qcompile.OfflineExecutor(ideal_device).expectation(
        qcompile.compile(program(), ideal_device), np.zeros((1, 0)), np.zeros(0)
    )
    np.testing.assert_allclose(found, ideal, atol=1e-9)


def test_a_qubit_that_was_not_calibrated_is_named() -> None:
    device = qcompile.load_device("fake_lima")
    executable = qcompile.compile(with_sub_products(program()), device)
    known = calibrate(qcompile.OfflineExecutor(device), [0], None, parts=["readout"])
    with pytest.raises(CalibrationError, match="calibrat"):
        product_mitigation(known, executable, 3)
