"""The layers of a circuit, without their phases by inputs, as operators on states in torch.

The runs of a layer are a matrix on each group of neighbouring qubits; couplings permute amplitudes
and change their signs. On few qubits one matrix does both, and what follows without symbols.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import torch

from qcompile.arrays import IntArray
from qcompile.ir import Gate
from qcompile.ir.gate import Rotation
from qcompile.states.couplings import on_amplitudes
from qcompile.states.layers import Layer
from qcompile.states.rotations import Rotations

_ONE_MATRIX = 4
"""Up to this many qubits, the runs and couplings of a layer are multiplied before they meet states:
on more that costs as much as it saves."""
_ONE_GROUP = 5
_GROUP = 4
"""The most qubits of a group where there are several: matrices on fewer qubits take less work."""
_PAULIS = np.array([[[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])

Matrices = Sequence[torch.Tensor]
"""The matrices (states, d, d) of each group of qubits."""


class Bound(NamedTuple):
    """The operators at some parameters: `matrices` (layers, d, d) of each group of qubits."""

    products: torch.Tensor
    turns: torch.Tensor
    matrices: tuple[torch.Tensor, ...]

    def of_layers(self) -> list[Matrices]:
        """The matrices (1, d, d) of each layer."""
        return _by_layer(matrix[:, None] for matrix in self.matrices)

    def inverses(self) -> list[Matrices]:
        """The matrices (2, d, d) of each layer that undo it, on a state and on a bra."""
        return _by_layer(torch.stack([m.mH, m.mT], dim=1) for m in self.matrices)


def _by_layer(matrices: Iterable[torch.Tensor]) -> list[Matrices]:
    return [*zip(*(of_group.unbind() for of_group in matrices), strict=True)]


def groups(width: int) -> list[range]:
    """The groups of neighbouring qubits."""
    count = 1 if width <= _ONE_GROUP else math.ceil(width / _GROUP)
    return [range(part[0], part[-1] + 1) for part in np.array_split(np.arange(width), count)]


class Operators:
    """The operators of `layers`; a layer without symbols may have become part of the one before.

    States are (number, 2**width, B), with the first qubit's bit highest.
    """

    def __init__(
        self, width: int, layers: Sequence[Layer], parameters: Sequence[str], dtype: torch.dtype
    ):
        is_merged = width <= _ONE_MATRIX
        self.layers, fixed = _merged(layers, width) if is_merged else ([*layers], None)
        self._fixed = None if fixed is None else fixed.to(dtype.to_complex())
        self._couplings = [
            _Permutation(layer.couplings, width, dtype)
            if layer.couplings and not is_merged
            else None
            for layer in self.layers
        ]
        runs = [run for layer in self.layers for _, run in sorted(layer.runs.items())]
        has_run = np.array([[q in layer.runs for q in range(width)] for layer in self.layers])
        # Where a qubit has no run stands the empty one behind the others.
        self._rotations = Rotations([*runs, ()], parameters, dtype)
        run_of_place = np.where(has_run.ravel(), has_run.cumsum() - 1, len(runs))
        self._groups = [
            _Group(qubits, width, run_of_place.reshape(-1, width), dtype)
            for qubits in groups(width)
        ]
        self.is_trained = [layer.is_trained for layer in self.layers]
        # Runs of other layers have no gradient: any place will do.
        row = np.cumsum(self.is_trained) - 1
        layer_of_run, qubit_of_run = np.nonzero(has_run)
        place_of_run = row[layer_of_run].clip(min=0) * width + qubit_of_run
        self._place_of_run = torch.tensor([*place_of_run, 0])

    def __call__(self, theta: torch.Tensor) -> Bound:
        """The operators at theta (parameters,)."""
        products, turns = self._rotations(theta)
        runs = self._rotations.matrices(products)
        matrices = tuple(group.matrices(runs) for group in self._groups)
        if self._fixed is not None:
            matrices = (self._fixed @ matrices[0],)
        return Bound(products, turns, matrices)

    def apply(self, layer: int, matrices: Matrices, state: torch.Tensor) -> torch.Tensor:
        """The states after a layer, given its matrices."""
        for group, matrix in zip(self._groups, matrices, strict=True):
            state = group.apply(matrix, state)
        coupling = self._couplings[layer]
        return state if coupling is None else coupling.apply(state)

    def undo(self, layer: int, inverses: Matrices, state: torch.Tensor) -> torch.Tensor:
        """The states before a layer, given the inverses of its matrices."""
        coupling = self._couplings[layer]
        state = state if coupling is None else coupling.undo(state)
        for group, inverse in zip(self._groups, inverses, strict=True):
            state = group.apply(inverse, state)
        return state

    def moments(self, state_and_bra: torch.Tensor) -> list[torch.Tensor]:
        """The sum of state x bra over rows, on each group of qubits: (d, d)."""
        return [group.moment(*state_and_bra.unbind()) for group in self._groups]

    def gradient(self, bound: Bound, moments: Sequence[Sequence[torch.Tensor]]) -> torch.Tensor:
        """The gradient by theta of what changes by 2 Re <bra|d state>.

        `moments` are those of state and bra before every trained layer; there is at least one.
        """
        of_groups = [
            group.spins(torch.stack(of_group))
            for group, of_group in zip(self._groups, zip(*moments, strict=True), strict=True)
        ]
        spins = torch.cat(of_groups, dim=1).reshape(-1, 3).index_select(0, self._place_of_run)
        return self._rotations.gradient(bound.products, bound.turns, spins)


class _Group:
    """Neighbouring qubits, of which a layer has one matrix.

    `run_of_place` (layers, width) is the run of each layer and qubit.
    """

    def __init__(self, qubits: range, width: int, run_of_place: IntArray, dtype: torch.dtype):
        self._size, self._layers = len(qubits), len(run_of_place)
        self._before, self._after = 2**qubits.start, 2 ** (width - qubits.stop)
        # Entry (i, j) of a Kronecker product is that of (bit of i, bit of j) of each factor.
        bits = np.arange(2**self._size) >> np.arange(self._size)[::-1, None] & 1
        entries = 2 * bits[:, :, None] + bits[:, None]  # (qubits, d, d)
        runs = run_of_place[:, qubits.start : qubits.stop, None, None]
        self._entries = torch.tensor((4 * runs + entries).ravel())
        self._spins = _spins(self._size, dtype)

    def matrices(self, runs: torch.Tensor) -> torch.Tensor:
        """The Kronecker products of matrices (runs, 2, 2), (layers, d, d)."""
        chosen = runs.reshape(-1).index_select(0, self._entries)
        size = 2**self._size
        return chosen.view(self._layers, self._size, size, size).prod(dim=1)

    def apply(self, matrix: torch.Tensor, state: torch.Tensor) -> torch.Tensor:
        if self._before == self._after == 1:
            return torch.bmm(matrix, state)
        number, _, rows = state.shape
        size, count = 2**self._size, number * self._before
        each = matrix[:, None].expand(-1, self._before, -1, -1).reshape(count, size, size)
        parts = state.view(count, size, self._after * rows)
        return torch.bmm(each, parts).view(state.shape)

    def moment(self, state: torch.Tensor, bra: torch.Tensor) -> torch.Tensor:
        if self._before == self._after == 1:
            return torch.mm(state, bra.T)
        shape = self._before, 2**self._size, self._after * state.shape[1]
        return torch.bmm(state.view(shape), bra.view(shape).mT).sum(dim=0)

    def spins(self, moments: torch.Tensor) -> torch.Tensor:
        """Im <bra|P|state> for P = X, Y, Z of each qubit: (layers, d, d) to (layers, size, 3)."""
        parts = torch.view_as_real(moments).reshape(len(moments), -1)
        return (parts @ self._spins).reshape(-1, self._size, 3)


def _spins(size: int, dtype: torch.dtype) -> torch.Tensor:
    """The linear map from the parts of a moment (d, d, 2) to Im tr(P moment), (2 d d, 3 size)."""
    columns = []
    for qubit in range(size):
        for pauli in _PAULIS:
            left = np.kron(np.eye(2**qubit), pauli)
            matrix = np.kron(left, np.eye(2 ** (size - qubit - 1))).T
            # Im(p m) = Im p Re m + Re p Im m
            columns.append(np.stack([matrix.imag, matrix.real], axis=-1).ravel())
    return torch.tensor(np.array(columns).T, dtype=dtype)


class _Permutation:
    """Couplings on amplitudes."""

    def __init__(self, couplings: Sequence[Gate], width: int, dtype: torch.dtype):
        source, sign = on_amplitudes(couplings, width)
        moves = not np.array_equal(source, np.arange(len(source)))
        self._source = torch.tensor(source) if moves else None
        self._back = torch.tensor(source.argsort()) if moves else None
        self._sign = torch.tensor(sign, dtype=dtype)[:, None, None] if (sign < 0).any() else None

    def apply(self, state: torch.Tensor) -> torch.Tensor:
        return self._signed(state if self._source is None else state.index_select(1, self._source))

    def undo(self, state: torch.Tensor) -> torch.Tensor:
        state = self._signed(state)
        return state if self._back is None else state.index_select(1, self._back)

    def _signed(self, state: torch.Tensor) -> torch.Tensor:
        if self._sign is None:
            return state
        return torch.view_as_complex(torch.view_as_real(state) * self._sign)


def kronecker(factors: Sequence[torch.Tensor]) -> torch.Tensor:
    """The Kronecker product of matrices (..., 2, 2), the first one's index slowest."""
    product = factors[0]
    for factor in factors[1:]:
        product = product[..., :, None, :, None] * factor[..., None, :, None, :]
        product = product.flatten(-4, -3).flatten(-2, -1)
    return product


def _merged(layers: Sequence[Layer], width: int) -> tuple[list[Layer], torch.Tensor]:
    """The layers with symbols, and the first; and what follows the runs of each, (layers, d, d)."""
    kept: list[Layer] = []
    fixed: list[torch.Tensor] = []
    for layer in layers:
        source, sign = on_amplitudes(layer.couplings, width)
        couplings = torch.tensor(sign[:, None] * np.eye(2**width)[source], dtype=torch.complex128)
        if kept and layer.is_fixed:
            fixed[-1] = couplings @ _runs_matrix(layer, width) @ fixed[-1]
        else:
            kept.append(layer)
            fixed.append(couplings)
    return kept, torch.stack(fixed)


def _runs_matrix(layer: Layer, width: int) -> torch.Tensor:
    """The matrix of a layer's runs, which have no symbols."""
    runs: list[Sequence[Rotation]] = [layer.runs.get(qubit, ()) for qubit in range(width)]
    rotations = Rotations(runs, (), torch.float64)
    products, _ = rotations(torch.empty(0, dtype=torch.float64))
    return kronecker(rotations.matrices(products).unbind())
