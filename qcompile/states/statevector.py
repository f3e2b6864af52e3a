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
from qcompile.ir import Angle, Circuit, Gate, Program
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
    """The matrices of runs: those that read inputs for every row, the others once."""

    def __init__(self, runs: Program, dtype: torch.dtype):
        inputs = set(runs.inputs)
        reads = [not inputs.isdisjoint(circuit.symbols) for circuit in runs.circuits]
        self._groups = []
        for chosen in (True, False):
            numbers = [i for i, read in enumerate(reads) if read == chosen]
            steps = _steps(runs, [runs.circuits[i] for i in numbers], dtype)
            self._groups.append((numbers, steps))
        self._count, self._dtype = len(runs), dtype

    def __call__(self, x: torch.Tensor, theta: torch.Tensor) -> list[torch.Tensor]:
        """A matrix (B or 1, 2, 2) for each run, and the identity."""
        eye = torch.eye(2, dtype=self._dtype.to_complex(), device=theta.device)[None]
        matrices = [eye] * (self._count + 1)
        for numbers, steps in self._groups:
            if numbers:
                for number, matrix in zip(numbers, _matrices(steps, x, theta), strict=True):
                    matrices[number] = matrix
        return matrices


_Steps = list[tuple[str, AngleTable]]


def _steps(program: Program, runs: Sequence[Circuit], dtype: torch.dtype) -> _Steps:
    """Rotations of all runs about z and y in turn: the axis, and the angles."""
    columns = [alternating(run) for run in runs]
    steps = []
    for position in range(max(map(len, columns), default=0)):
        angles = [c[position] if position < len(c) else Angle() for c in columns]
        table = AngleTable(angles, program.inputs, program.parameters, torch, dtype)
        steps.append(("zy"[position % 2], table))
    return steps


def _matrices(steps: _Steps, x: torch.Tensor, theta: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """The SU(2) matrices of all runs, each (B or 1, 2, 2), built from their first columns."""
    alpha: torch.Tensor | None = None
    beta: torch.Tensor | None = None
    for axis, table in steps:
        angles = torch.as_tensor(table(x, theta), dtype=theta.dtype)
        half = angles.reshape(-1, angles.shape[-1]) / 2
        if alpha is None or beta is None:
            one = torch.ones_like(half)
            alpha, beta = torch.complex(one, 0 * one), torch.complex(0 * one, 0 * one)
        if axis == "z":
            phase = torch.polar(torch.ones_like(half), half)
            alpha, beta = alpha * phase.conj(), beta * phase
        else:
            cos, sin = torch.cos(half), torch.sin(half)
            alpha, beta = cos * alpha - sin * beta, sin * alpha + cos * beta
    assert alpha is not None
    assert beta is not None
    rows = [torch.stack([alpha, -beta.conj()], -1), torch.stack([beta, alpha.conj()], -1)]
    return torch.stack(rows, dim=-2).unbind(dim=1)


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
        self._left = width // 2
        self._layers, couplings = _layers(width, parts, identity)
        self._signs = torch.tensor(signs, dtype=dtype)
        self._couplings = [
            (
                None if np.array_equal(source, np.arange(2**width)) else torch.tensor(source),
                torch.tensor(sign, dtype=dtype),
            )
            for source, sign in couplings
        ]

    def __call__(self, matrices: Sequence[torch.Tensor], rows: int) -> torch.Tensor:
        """`<O>` (rows, observables of this circuit) for the matrices of all runs."""
        state: torch.Tensor | None = None
        for runs, (source, sign) in zip(self._layers, self._couplings, strict=True):
            chosen = [matrices[run] for run in runs]
            left, right = _product(chosen[: self._left]), _product(chosen[self._left :])
            if state is None:  # from |0>: the first columns
                state = left[:, :, :1] * right[:, None, :, 0]
            else:
                state = left @ state @ right.mT
            flat = state.flatten(1)
            flat = flat if source is None else flat.index_select(1, source)
            state = (flat * sign).reshape(state.shape)
        assert state is not None
        flat = state.flatten(1)
        found: torch.Tensor = (flat.real**2 + flat.imag**2) @ self._signs
        return found.expand(rows, -1)


def _product(matrices: Sequence[torch.Tensor]) -> torch.Tensor:
    """The Kronecker product of matrices (B or 1, 2, 2), the first one's index slowest."""
    product = matrices[0]
    for matrix in matrices[1:]:
        product = product[:, :, None, :, None] * matrix[:, None, :, None, :]
        product = product.flatten(3, 4).flatten(1, 2)
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
