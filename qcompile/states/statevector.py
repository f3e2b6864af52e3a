"""Statevectors of programs in torch: exact, for whole batches, with gradients.

A circuit is layers: a matrix for each qubit, then couplings, which permute amplitudes and change
their signs. The matrices of a layer are multiplied into two, one for the left and one for the right
half of the qubits, so that a layer is two products of small matrices with the state.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from qcompile.arrays import FloatArray, IntArray
from qcompile.errors import CircuitError
from qcompile.ir import Angle, Gate, Program
from qcompile.ir.runs import Run, split
from qcompile.ir.table import AngleTable
from qcompile.limits import MAX_STATE_QUBITS
from qcompile.passes.to_couplings import ToCouplings
from qcompile.simulate import Simulator, alternating


class Statevectors:
    """Evaluates a program without noise: `<O>` of its observables, with gradients.

    Raises:
        CircuitError: a circuit has too many qubits, or the program is fused.
    """

    def __init__(self, program: Program, dtype: torch.dtype = torch.float32):
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
        couplings = ToCouplings(("cx", "cz"))
        runs, skeleton = split(couplings.apply(Program(tuple(wide), *symbols)))
        self._runs = _Runs(runs, dtype)
        self._blocks = [
            _Block(width, parts, _signs(program, i), len(runs), dtype)
            for i, (width, parts) in zip(order[len(narrow) :], skeleton.circuits, strict=True)
        ]
        self._order = torch.tensor(_columns(program, order))

    def __call__(self, x: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        """`<O>` (B, observables) for x (B, inputs) and theta (parameters,)."""
        parts = [] if self._narrow is None else [self._narrow.expectation(x, theta)]
        matrices = self._runs(x, theta)
        parts += [block(matrices, len(x)) for block in self._blocks]
        return torch.cat(parts, dim=1).index_select(1, self._order)


class _Runs:
    """The SU(2) matrices of runs, built from their first columns."""

    def __init__(self, runs: Program, dtype: torch.dtype):
        columns = [alternating(run) for run in runs.circuits]
        self._shape, self._dtype = len(runs), dtype
        self._steps = []
        for position in range(max(map(len, columns), default=0)):
            angles = [c[position] if position < len(c) else Angle() for c in columns]
            table = AngleTable(angles, runs.inputs, runs.parameters, torch, dtype)
            self._steps.append(("zy"[position % 2], table))

    def __call__(self, x: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        """A matrix for each run, and the identity, (B or 1, runs + 1, 2, 2)."""
        alpha = torch.ones((1, self._shape), dtype=self._dtype.to_complex())
        beta = torch.zeros_like(alpha)
        for axis, table in self._steps:
            angles = torch.as_tensor(table(x, theta), dtype=self._dtype)
            half = angles.reshape(-1, self._shape) / 2
            if axis == "z":
                phase = torch.polar(torch.ones_like(half), half)
                alpha, beta = alpha * phase.conj(), beta * phase
            else:
                cos, sin = torch.cos(half), torch.sin(half)
                alpha, beta = cos * alpha - sin * beta, sin * alpha + cos * beta
        alpha, beta = (
            torch.nn.functional.pad(c, (0, 1), value=v) for c, v in ((alpha, 1), (beta, 0))
        )
        rows = [torch.stack([alpha, -beta.conj()], -1), torch.stack([beta, alpha.conj()], -1)]
        return torch.stack(rows, dim=-2)


class _Block:
    """One circuit of several qubits: its layers, and the signs of its observables."""

    def __init__(
        self,
        width: int,
        parts: Sequence[Run | Gate],
        signs: FloatArray,
        identity: int,
        dtype: torch.dtype,
    ):
        self._left, self._width = width // 2, width
        runs, couplings = _layers(width, parts, identity)
        self._layers, self._runs = len(runs), torch.tensor(runs).flatten()
        self._signs = torch.tensor(signs, dtype=dtype)
        self._couplings = [
            (
                None if np.array_equal(source, np.arange(2**width)) else torch.tensor(source),
                torch.tensor(sign, dtype=dtype),
            )
            for source, sign in couplings
        ]

    def __call__(self, matrices: torch.Tensor, rows: int) -> torch.Tensor:
        """`<O>` (rows, observables of this circuit) for the matrices of all runs."""
        chosen = matrices.index_select(1, self._runs).reshape(-1, self._layers, self._width, 2, 2)
        of_qubits = chosen.unbind(2)  # each (B or 1, layers, 2, 2)
        left = _product(of_qubits[: self._left]).unbind(1)
        right = _product(of_qubits[self._left :]).mT.unbind(1)
        state = left[0][:, :, :1] * right[0][:, :1, :]  # from |0>: the first columns
        for layer, (source, sign) in enumerate(self._couplings):
            if layer:
                state = left[layer] @ state @ right[layer]
            flat = state.flatten(1)
            flat = flat if source is None else flat.index_select(1, source)
            state = (flat * sign).reshape(state.shape)
        flat = state.flatten(1)
        found: torch.Tensor = (flat.real**2 + flat.imag**2) @ self._signs
        return found.expand(rows, -1)


def _product(matrices: Sequence[torch.Tensor]) -> torch.Tensor:
    """The Kronecker product of matrices (..., 2, 2), the first one's index slowest."""
    product = matrices[0]
    for factor in matrices[1:]:
        product = product[..., :, None, :, None] * factor[..., None, :, None, :]
        product = product.flatten(-4, -3).flatten(-2, -1)
    return product


def _layers(
    width: int, parts: Sequence[Run | Gate], identity: int
) -> tuple[list[list[int]], list[tuple[IntArray, FloatArray]]]:
    """The runs of each layer, one a qubit, and what its couplings do: sources and signs."""
    runs: list[list[int]] = [[identity] * width]
    couplings = [(np.arange(2**width), np.ones(2**width))]
    last_run, last_coupling = [0] * width, [-1] * width
    for part in parts:
        if isinstance(part, Run):
            layer = last_coupling[part.qubit] + 1
            last_run[part.qubit] = layer
        else:
            layer = max(max(last_run[q], last_coupling[q]) for q in part.qubits)
            for qubit in part.qubits:
                last_coupling[qubit] = layer
        if layer == len(runs):
            runs.append([identity] * width)
            couplings.append((np.arange(2**width), np.ones(2**width)))
        if isinstance(part, Run):
            runs[layer][part.qubit] = part.number
        else:
            source, sign = _coupling(part, width)
            before_source, before_sign = couplings[layer]
            couplings[layer] = before_source[source], sign * before_sign[source]
    return runs, couplings


def _coupling(gate: Gate, width: int) -> tuple[IntArray, FloatArray]:
    """The amplitude that each amplitude becomes after a cx or cz, and its sign."""
    number = np.arange(2**width)
    control, target = (width - 1 - qubit for qubit in gate.qubits)
    is_one = number >> control & 1
    if gate.name == "cx":
        return number ^ (is_one << target), np.ones(2**width)
    return number, np.asarray(1.0 - 2.0 * (is_one & number >> target))


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
