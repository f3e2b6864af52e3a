"""Runs of z and y rotations as unit quaternions in torch, and their gradients.

The quaternion (w, x, y, z) is the matrix w I - i (x X + y Y + z Z), so that a rotation by a about z
is (cos(a/2), 0, 0, sin(a/2)), and products of quaternions are products of matrices.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch

from qcompile.ir import Angle
from qcompile.ir.gate import Rotation
from qcompile.states.forms import Forms

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
        self._forms = Forms([angle / 2 for row in angles for angle in row], parameters, dtype)
        self._shape = length, len(runs), 1, 1
        units = [_LEFT[first[position % 2]] for position in range(length)]
        self._units = torch.tensor(units, dtype=dtype)  # (positions, 4, 4)
        self._eye = torch.eye(4, dtype=dtype)
        self._right = torch.tensor(_RIGHT, dtype=dtype).reshape(3, 16)
        self._matrix = torch.tensor(_MATRIX, dtype=dtype)

    def __call__(self, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The products of the first rotations of each run, and the rotations by themselves.

        The products are quaternions (positions, runs, 4); the rotations are multiplications from
        the left, (positions, runs, 4, 4).
        """
        half = self._forms(theta[:, None]).view(self._shape)
        turns = half.cos() * self._eye + half.sin() * self._units[:, None]
        first, *others = turns.unbind()
        products = [first[:, :, :1]]  # the first column: the turned 1
        for turn in others:
            products.append(torch.bmm(turn, products[-1]))
        return torch.cat(products, dim=2).permute(2, 0, 1), turns

    def matrices(self, products: torch.Tensor) -> torch.Tensor:
        """The matrices (runs, 2, 2) of the products of whole runs."""
        parts = (products[-1] @ self._matrix).view(-1, 2, 2, 2)
        return torch.view_as_complex(parts)

    def gradient(
        self, products: torch.Tensor, turns: torch.Tensor, spins: torch.Tensor
    ) -> torch.Tensor:
        """The gradient by the parameters.

        `spins` (runs, 3) are the derivatives by the angles of rotations about x, y and z before
        each run.
        """
        right = (spins @ self._right).view(-1, 4, 4)
        inwards = [torch.bmm(2 * right, products[-1, :, :, None])]  # by the product at a position
        for turn in reversed(turns[1:].unbind()):
            inwards.append(torch.bmm(turn.mT, inwards[-1]))
        after = torch.cat(inwards[::-1], dim=2).permute(2, 0, 1)  # (positions, runs, 4)
        by_halves = (after * torch.bmm(products, self._units.mT)).sum(dim=2)
        return self._forms.gradient(by_halves.view(-1, 1))[:, 0]
