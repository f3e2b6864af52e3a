"""Statevectors of programs in torch: exact, for whole batches, with gradients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from qcompile.arrays import FloatArray
from qcompile.errors import CircuitError
from qcompile.ir import Program
from qcompile.limits import MAX_STATE_QUBITS
from qcompile.passes.to_couplings import ToCouplings
from qcompile.simulate import Simulator
from qcompile.states.block import Block
from qcompile.states.layers import layers


class Statevectors:
    """Evaluates a program without noise: `<O>` of its observables, with gradients.

    Raises:
        CircuitError: a circuit has too many qubits, the program is fused, or `dtype` is neither
            float32 nor float64.
    """

    def __init__(self, program: Program, dtype: torch.dtype = torch.float32):
        if dtype not in (torch.float32, torch.float64):
            raise CircuitError(
                f"Circuits cannot be evaluated in {dtype}.", "Use torch.float32 or torch.float64."
            )
        self.dtype = dtype
        widest = max(program.widths, default=1)
        if widest > MAX_STATE_QUBITS:
            raise CircuitError(
                f"A circuit has {widest} qubits.",
                f"Statevectors are computed on up to {MAX_STATE_QUBITS} qubits.",
            )
        if program.late_angles:
            raise CircuitError(
                "A fused program cannot be evaluated.", "Pass the program before it was compiled."
            )
        order = np.argsort([width > 1 for width in program.widths], kind="stable").tolist()
        narrow = [program.circuits[i] for i in order if program.widths[i] == 1]
        wide = [program.circuits[i] for i in order if program.widths[i] > 1]
        symbols = program.inputs, program.parameters
        self._narrow = Simulator(Program(tuple(narrow), *symbols), torch, dtype) if narrow else None
        with_cx = ToCouplings(("cx", "cz")).apply(Program(tuple(wide), *symbols))
        self._blocks = [
            Block(
                circuit.width,
                layers(circuit.gates, circuit.width, frozenset(program.inputs)),
                _signs(program, number),
                *symbols,
                dtype,
            )
            for number, circuit in zip(order[len(narrow) :], with_cx.circuits, strict=True)
        ]
        columns = _columns(program, order)
        self._order = None if columns == [*range(len(columns))] else torch.tensor(columns)

    def __call__(self, x: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        """`<O>` (B, observables) for x (B, inputs) and theta (parameters,)."""
        parts = [] if self._narrow is None else [self._narrow.expectation(x, theta)]
        parts += [block(x, theta) for block in self._blocks]
        found = parts[0] if len(parts) == 1 else torch.cat(parts, dim=1)
        return found if self._order is None else found.index_select(1, self._order)


def _signs(program: Program, circuit: int) -> FloatArray:
    """(-1)**(ones among the bits) for each amplitude and each observable of a circuit."""
    first, width = program.first_bits[circuit], program.widths[circuit]
    number = np.arange(2**width)
    signs = [
        np.prod([1 - 2 * (number >> (first + width - 1 - bit) & 1) for bit in observable], axis=0)
        for observable in program.measured
        if first <= observable[0] < first + width
    ]
    return np.array(signs, dtype=float).reshape(-1, 2**width).T


def _columns(program: Program, order: Sequence[int]) -> list[int]:
    """The column of each observable when those of the circuits in `order` stand side by side.

    A circuit of one qubit has one column, whether or not an observable is on it.
    """
    first, widths = program.first_bits, program.widths
    column, columns = 0, [0] * len(program.measured)
    for circuit in order:
        own = [
            number
            for number, observable in enumerate(program.measured)
            if first[circuit] <= observable[0] < first[circuit] + widths[circuit]
        ]
        for place, number in enumerate(own):
            columns[number] = column + (place if widths[circuit] > 1 else 0)
        column += len(own) if widths[circuit] > 1 else 1
    return columns
