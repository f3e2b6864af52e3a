"""Angle tables: their values for many angles, and their memory."""

from __future__ import annotations

import tracemalloc

import numpy as np

from qcompile.ir import Angle
from qcompile.ir.table import AngleTable


def test_many_angles_take_no_dense_table():
    count = 5_000  # a table of count x count doubles is 200 MB
    symbols = [f"x{i}" for i in range(count)]
    angles = [Angle.of(f"x{i}+0.5*x{(7 * i + 3) % count}-1") for i in range(count)]
    x = np.random.default_rng(0).normal(size=(2, count))
    tracemalloc.start()
    found = AngleTable(angles, symbols, ())(x, np.zeros(0))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20e6
    other = (7 * np.arange(count) + 3) % count
    np.testing.assert_allclose(found, x + 0.5 * x[:, other] - 1, atol=1e-14)


def test_forms_of_several_symbols_few_and_many():
    for count in (3, 1_500):  # as a matrix, and one symbol at a time
        symbols = [f"x{i}" for i in range(count)]
        angles = [Angle.of("2*x0-x2+0.25")] + [Angle.of(f"x{i}") for i in range(1, count)]
        x = np.random.default_rng(1).normal(size=(4, count))
        found = AngleTable(angles, symbols, ("t",))(x, np.zeros(1))
        np.testing.assert_allclose(found[:, 0], 2 * x[:, 0] - x[:, 2] + 0.25, atol=1e-15)
        np.testing.assert_array_equal(found[:, 1:], x[:, 1:])
