"""Statevectors in torch against Qiskit's, and their gradients against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from wide import ANY, operator, random_circuit

from qcompile.errors import CircuitError
from qcompile.ir import Circuit, Program
from qcompile.states.statevector import Statevectors

SYMBOLS = ("x0", "x1", "theta0", "theta1")


def expected(program: Program, row: np.ndarray) -> list[float]:
    """<O> of all observables for one row of values, from Qiskit's unitaries."""
    values = dict(zip(SYMBOLS, row.tolist(), strict=True))
    found = []
    for observable in program.measured:
        circuit = max(i for i, first in enumerate(program.first_bits) if first <= observable[0])
        p = np.abs(operator(program.circuits[circuit], values)[:, 0]) ** 2
        bits = np.arange(len(p))[:, None] >> [b - program.first_bits[circuit] for b in observable]
        found.append(float(p @ (1 - 2 * (bits.sum(axis=1) % 2))))
    return found


def random_program(seed: int) -> Program:
    rng = np.random.default_rng(seed)
    widths = rng.permutation([1, 1, 2, 3, 5]).tolist()
    program = Program.of([random_circuit(rng, ANY, width) for width in widths], 2, 2)
    first, wide = program.first_bits, [i for i, width in enumerate(widths) if width > 1]
    products = [tuple(range(first[i], first[i] + widths[i])) for i in wide]
    alone = rng.permutation(program.bits).tolist()
    return replace(program, observables=(*products, *((bit,) for bit in alone)))


@pytest.mark.parametrize("seed", range(12))
def test_it_is_the_statevector(seed: int) -> None:
    program = random_program(seed)
    values = np.random.default_rng(seed).uniform(-4, 4, (3, 4))
    values[:, 2:] = values[0, 2:]
    state = Statevectors(program, torch.float64)
    found = state(torch.tensor(values[:, :2]), torch.tensor(values[0, 2:]))
    np.testing.assert_allclose(found, [expected(program, row) for row in values], atol=1e-12)
    single = Statevectors(program)(
        torch.tensor(values[:, :2], dtype=torch.float32),
        torch.tensor(values[0, 2:], dtype=torch.float32),
    )
    assert single.dtype == torch.float32
    np.testing.assert_allclose(single, found, atol=2e-5)


def test_the_default_observables_are_all_bits_in_order() -> None:
    rng = np.random.default_rng(0)
    program = Program.of([random_circuit(rng, ANY, width) for width in (1, 3, 1, 2)], 2, 2)
    values = np.array([0.3, -1.0, 2.0, 0.7])
    found = Statevectors(program, torch.float64)(
        torch.tensor(values[None, :2]), torch.tensor(values[2:])
    )
    np.testing.assert_allclose(found[0], expected(program, values), atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_gradients_are_exact(seed: int) -> None:
    state = Statevectors(random_program(seed), torch.float64)
    generator = torch.Generator().manual_seed(seed)
    x = torch.randn(2, 2, dtype=torch.float64, generator=generator, requires_grad=True)
    theta = torch.randn(2, dtype=torch.float64, generator=generator, requires_grad=True)
    assert torch.autograd.gradcheck(state, (x, theta))


def test_what_cannot_be_evaluated_is_refused() -> None:
    wide = Program.of([Circuit((), 17)])
    with pytest.raises(CircuitError, match=r"17 qubits.\n.*up to 16"):
        Statevectors(wide)
