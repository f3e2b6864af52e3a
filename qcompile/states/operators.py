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
"""The matrix (d, d) of each group of qubits."""


class Bound(NamedTuple):
    """The operators at some parameters: `matrices` (layers, d, d) of each group of qubits."""

    products: torch.Tensor
    turns: torch.Tensor
    matrices: tuple[torch.Tensor, ...]

    def of_layers(self) -> list[Matrices]:
        """The matrices of each layer."""
        return _by_layer(self.matrices)

    def transposes(self) -> list[Matrices]:
        return _by_layer(matrix.mT for matrix in self.matrices)

    def inverses(self) -> list[Matrices]:
        return _by_layer(matrix.mH.resolve_conj() for matrix in self.matrices)


def _by_layer(matrices: Iterable[torch.Tensor]) -> list[Matrices]:
    return [*zip(*(of_group.unbind() for of_group in matrices), strict=True)]


def groups(width: int) -> list[range]:
    """The groups of neighbouring qubits."""
    count = 1 if width <= _ONE_GROUP else math.ceil(width / _GROUP)
    return [range(part[0], part[-1] + 1) for part in np.array_split(np.arange(width), count)]


class Operators:
    """The operators of `layers`; a layer without symbols may have become part of the one before.

    A state is (2**width, B), with the first qubit's bit highest.
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
        self._run_of_place = torch.tensor(run_of_place)
        self._place_of_run = torch.tensor([*np.flatnonzero(has_run), 0])
        self._groups = [_Group(qubits, width, dtype) for qubits in groups(width)]

    def __call__(self, theta: torch.Tensor) -> Bound:
        """The operators at theta (parameters,)."""
        products, turns = self._rotations(theta)
        runs = self._rotations.matrices(products).index_select(0, self._run_of_place)
        of_qubits = runs.reshape(len(self.layers), -1, 2, 2).unbind(1)
        matrices = tuple(
            kronecker([of_qubits[qubit] for qubit in group.qubits]) for group in self._groups
        )
        if self._fixed is not None:
            matrices = (self._fixed @ matrices[0],)
        return Bound(products, turns, matrices)

    def apply(self, layer: int, matrices: Matrices, state: torch.Tensor) -> torch.Tensor:
        """The state after a layer, given its matrices."""
        for group, matrix in zip(self._groups, matrices, strict=True):
            state = group.apply(matrix, state)
        coupling = self._couplings[layer]
        return state if coupling is None else coupling.apply(state)

    def undo(self, layer: int, inverses: Matrices, state: torch.Tensor) -> torch.Tensor:
        """The state before a layer, given the inverses of its matrices."""
        coupling = self._couplings[layer]
        state = state if coupling is None else coupling.undo(state)
        for group, inverse in zip(self._groups, inverses, strict=True):
            state = group.apply(inverse, state)
        return state

    def moments(self, state: torch.Tensor, bra: torch.Tensor) -> list[torch.Tensor]:
        """The sum of state x bra over rows, on each group of qubits: (d, d)."""
        return [group.moment(state, bra) for group in self._groups]

    def gradient(self, bound: Bound, moments: Sequence[Sequence[torch.Tensor]]) -> torch.Tensor:
        """The gradient by theta of what changes by 2 Re <bra|d state>.

        `moments` are those of state and bra before every layer.
        """
        of_groups = [
            group.spins(torch.stack(of_group))
            for group, of_group in zip(self._groups, zip(*moments, strict=True), strict=True)
        ]
        spins = torch.cat(of_groups, dim=1).reshape(-1, 3).index_select(0, self._place_of_run)
        return self._rotations.gradient(bound.products, bound.turns, spins)


class _Group:
    """Neighbouring qubits, of which a layer has one matrix."""

    def __init__(self, qubits: range, width: int, dtype: torch.dtype):
        self.qubits, self.size = qubits, len(qubits)
        self._before, self._after = 2**qubits.start, 2 ** (width - qubits.stop)
        rows = []
        for qubit in range(self.size):
            for pauli in _PAULIS:
                sides = np.eye(2**qubit), np.eye(2 ** (self.size - qubit - 1))
                matrix = np.kron(np.kron(sides[0], pauli), sides[1]).T
                # Im(p c) = Im p Re c + Re p Im c
                rows.append(np.stack([matrix.imag, matrix.real], axis=-1).ravel())
        self._spins = torch.tensor(np.array(rows).T, dtype=dtype)

    def apply(self, matrix: torch.Tensor, state: torch.Tensor) -> torch.Tensor:
        if self._before == self._after == 1:
            return torch.mm(matrix, state)
        after = torch.bmm(matrix.expand(self._before, -1, -1), self._view(state))
        return after.view(state.shape)

    def moment(self, state: torch.Tensor, bra: torch.Tensor) -> torch.Tensor:
        if self._before == self._after == 1:
            return torch.mm(state, bra.T)
        return torch.bmm(self._view(state), self._view(bra).mT).sum(dim=0)

    def _view(self, state: torch.Tensor) -> torch.Tensor:
        """A state with the group's qubits on the axis in the middle."""
        return state.view(self._before, 2**self.size, self._after * state.shape[1])

    def spins(self, moments: torch.Tensor) -> torch.Tensor:
        """Im <bra|P|state> for P = X, Y, Z of each qubit: (layers, d, d) to (layers, size, 3)."""
        parts = torch.view_as_real(moments).reshape(len(moments), -1)
        return (parts @ self._spins).reshape(-1, self.size, 3)


class _Permutation:
    """Couplings on amplitudes."""

    def __init__(self, couplings: Sequence[Gate], width: int, dtype: torch.dtype):
        source, sign = on_amplitudes(couplings, width)
        moves = not np.array_equal(source, np.arange(len(source)))
        self._source = torch.tensor(source) if moves else None
        self._back = torch.tensor(source.argsort()) if moves else None
        self._sign = torch.tensor(sign, dtype=dtype)[:, None] if (sign < 0).any() else None

    def apply(self, state: torch.Tensor) -> torch.Tensor:
        state = state if self._source is None else state.index_select(0, self._source)
        return state if self._sign is None else state * self._sign

    def undo(self, state: torch.Tensor) -> torch.Tensor:
        state = state if self._sign is None else state * self._sign
        return state if self._back is None else state.index_select(0, self._back)


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
