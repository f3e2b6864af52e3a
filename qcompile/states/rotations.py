"""Runs of z and y rotations as unit quaternions in torch, and their gradients.

The quaternion (w, x, y, z) is the matrix w I - i (x X + y Y + z Z), so that a rotation by a about z
is (cos(a/2), 0, 0, sin(a/2)), and products of quaternions are products of matrices.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch

from qcompile.ir import Angle
from qcompile.ir.gate import Rotation

_LEFT = {
    "y": [[0, 0, -1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, -1, 0, 0]],
    "z": [[0, 0, 0, -1], [0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, 0]],
}
"""Multiplication by the units j and k from the left."""
_RIGHT = [
    [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]],
    [[0, 0, -1, 0], [0, 0, 0, -1], [1, 0, 0, 0], [0, 1, 0, 0]],
    [[0, 0, 0, -1], [0, 0, 1, 0], [0, -1, 0, 0], [1, 0, 0, 0]],
]
"""Multiplication by the units i, j and k from the right."""
_MATRIX = [
    [1, 0, 0, 0, 0, 0, 1, 0],
    [0, 0, 0, -1, 0, -1, 0, 0],
    [0, 0, -1, 0, 1, 0, 0, 0],
    [0, -1, 0, 0, 0, 0, 0, 1],
]
"""The real and imaginary parts of the matrix of each unit, row by row."""


class Forms:
    """Affine forms in symbols: values (symbols, ...) to (forms, ...), and gradients back.

    Their constants are added to every column. `columns` is the number of further axes of values.
    """

    def __init__(
        self, angles: Sequence[Angle], symbols: Sequence[str], dtype: torch.dtype, columns: int
    ):
        number = {symbol: i for i, symbol in enumerate(symbols)}
        terms = [(i, number[s], c) for i, angle in enumerate(angles) for s, c in angle.terms]
        forms, read, factors = zip(*terms, strict=True) if terms else ((), (), ())
        self._forms, self._read = torch.tensor(forms).long(), torch.tensor(read).long()
        constants = torch.tensor([angle.constant for angle in angles], dtype=dtype)
        self._constants = constants.reshape(-1, *[1] * columns)
        self._factors = torch.tensor(factors, dtype=dtype).reshape(-1, *[1] * columns)
        self._symbols = len(symbols)
        self._is_gather = forms == tuple(range(len(angles))) and not constants.any()

    def __call__(self, values: torch.Tensor) -> torch.Tensor:
        terms = values.index_select(0, self._read) * self._factors
        if self._is_gather:
            return terms
        constants = self._constants.expand(-1, *values.shape[1:])
        return constants.index_add(0, self._forms, terms)

    def gradient(self, by_forms: torch.Tensor) -> torch.Tensor:
        """The gradient by the symbols (symbols, ...)."""
        by_terms = by_forms if self._is_gather else by_forms.index_select(0, self._forms)
        by_symbols = by_forms.new_zeros((self._symbols, *by_forms.shape[1:]))
        return by_symbols.index_add_(0, self._read, by_terms * self._factors)


class Rotations:
    """Runs of rotations, about z and y in turn, by angles affine in the parameters."""

    def __init__(
        self, runs: Sequence[Sequence[Rotation]], parameters: Sequence[str], dtype: torch.dtype
    ):
        first = "zy" if any(run and run[0][0] == "z" for run in runs) else "yz"
        starts = [int(bool(run) and run[0][0] != first[0]) for run in runs]
        length = max(1, *(start + len(run) for start, run in zip(starts, runs, strict=True)))
        angles = [[Angle()] * len(runs) for _ in range(length)]
        for number, (start, run) in enumerate(zip(starts, runs, strict=True)):
            for position, (_, angle) in enumerate(run, start):
                angles[position][number] = angle
        halves = [angle / 2 for row in angles for angle in row]
        self._forms = Forms(halves, parameters, dtype, 0)
        self._shape = length, len(runs), 1
        units = [_LEFT[first[position % 2]] for position in range(length)]
        self._units = torch.tensor(units, dtype=dtype)[:, None]  # (positions, 1, 4, 4)
        self._eye = torch.eye(4, dtype=dtype)
        self._right = torch.tensor(_RIGHT, dtype=dtype).reshape(3, 16)
        self._matrix = torch.tensor(_MATRIX, dtype=dtype)

    def __call__(self, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The products of the first rotations of each run, and the rotations by themselves.

        The products are quaternions (positions, runs, 4, 1); the rotations are multiplications from
        the left, (positions, runs, 4, 4).
        """
        half = self._forms(theta).reshape(*self._shape, 1)
        turns = half.cos() * self._eye + half.sin() * self._units
        first, *others = turns.unbind()
        products = [first[:, :, :1]]  # the first column: the turned 1
        for turn in others:
            products.append(turn @ products[-1])
        return torch.stack(products), turns

    def matrices(self, products: torch.Tensor) -> torch.Tensor:
        """The matrices (runs, 2, 2) of the products of whole runs."""
        parts = (products[-1, :, :, 0] @ self._matrix).reshape(-1, 2, 2, 2)
        return torch.view_as_complex(parts)

    def gradient(
        self, products: torch.Tensor, turns: torch.Tensor, spins: torch.Tensor
    ) -> torch.Tensor:
        """The gradient by the parameters.

        `spins` (runs, 3) are the derivatives by the angles of rotations about x, y and z before
        each run.
        """
        right = (spins @ self._right).reshape(-1, 4, 4)
        inwards = [2 * right @ products[-1]]  # the gradient by the product at a position
        for turn in reversed(turns[1:].unbind()):
            inwards.append(turn.mT @ inwards[-1])
        after = torch.stack(inwards[::-1])  # (positions, runs, 4, 1)
        by_halves = (after * (self._units @ products)).sum(dim=(2, 3))
        return self._forms.gradient(by_halves.flatten())
