"""Affine angles in torch, and their gradients."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from qcompile.ir import Angle

_MAX_DENSE = 1 << 16
"""The most entries of a matrix of coefficients; a larger one is nearly empty."""


class Forms:
    """Affine angles: values (symbols, B) to (angles, B), and gradients back."""

    def __init__(self, angles: Sequence[Angle], symbols: Sequence[str], dtype: torch.dtype):
        number = {symbol: i for i, symbol in enumerate(symbols)}
        terms = [(i, number[s], c) for i, angle in enumerate(angles) for s, c in angle.terms]
        forms, read, factors = zip(*terms, strict=True) if terms else ((), (), ())
        self._forms, self._read = torch.tensor(forms).long(), torch.tensor(read).long()
        self._factors = torch.tensor(factors, dtype=dtype)[:, None]
        self._constants = torch.tensor([[angle.constant] for angle in angles], dtype=dtype)
        self._constants = self._constants.reshape(len(angles), 1)
        self._symbols = len(symbols)
        self._matrix: torch.Tensor | None = None
        if len(angles) * len(symbols) <= _MAX_DENSE:
            self._matrix = torch.zeros((len(angles), len(symbols)), dtype=dtype)
            self._matrix[self._forms, self._read] = self._factors[:, 0]

    def __len__(self) -> int:
        return len(self._constants)

    def __call__(self, values: torch.Tensor) -> torch.Tensor:
        if self._matrix is not None:
            return torch.addmm(self._constants, self._matrix, values)
        terms = values.index_select(0, self._read) * self._factors
        return self._constants.expand(-1, values.shape[1]).index_add(0, self._forms, terms)

    def gradient(self, by_angles: torch.Tensor) -> torch.Tensor:
        """The gradient by the symbols, (symbols, B)."""
        if self._matrix is not None:
            return self._matrix.T @ by_angles
        by_terms = by_angles.index_select(0, self._forms) * self._factors
        by_symbols = by_angles.new_zeros((self._symbols, by_angles.shape[1]))
        return by_symbols.index_add_(0, self._read, by_terms)
