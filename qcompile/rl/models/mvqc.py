"""The entangling circuit of Jerbi et al. (arXiv 2103.05577), exact and for a whole batch.

One qubit per feature, starting in |0>. A layer is: Ry and Rz with trained angles on every qubit, a
ring of CZ, then Ry(x) and Rz(x) (re-uploading); trained Ry and Rz close the circuit. `<Z>` of every
qubit goes into a linear layer, as in the SVQC.
"""

from __future__ import annotations

import torch

from qcompile.errors import TrainingError
from qcompile.rl.models.head import ReusedLinear, first_theta, input_scale
from qcompile.rl.settings import Settings

_MAX_QUBITS = 12


class MVQC(torch.nn.Module):
    """Multi-qubit variational circuit and a linear layer: observations to outputs.

    The number of layers is the number of input scales.

    Raises:
        TrainingError: there are too many features to simulate.
    """

    def __init__(self, features: int, outputs: int, settings: Settings, generator: torch.Generator):
        super().__init__()
        if features > _MAX_QUBITS:
            raise TrainingError(
                f"Model 'mvqc' needs one qubit per feature; there are {features} features.",
                f"It can train at most {_MAX_QUBITS} qubits.",
            )
        self._qubits, self._layers = features, len(settings.scales)
        self.log_scale = input_scale(settings, features)
        self.theta = first_theta(settings, (self._layers + 1, features, 2), generator)
        self.head = ReusedLinear(features, outputs, settings, generator)
        bits = torch.arange(2**features)[:, None] >> torch.arange(features - 1, -1, -1) & 1
        pairs = bits * bits.roll(-1, dims=1)
        ring = pairs[:, : features if features > 2 else features - 1].sum(dim=1)
        self._left = features // 2
        self._entangle: torch.Tensor
        self._signs: torch.Tensor
        shape = (2**self._left, 2 ** (features - self._left))
        self.register_buffer("_entangle", (1.0 - 2.0 * (ring % 2)).reshape(shape), persistent=False)
        self.register_buffer("_signs", 1.0 - 2.0 * bits, persistent=False)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to outputs (B, outputs)."""
        outputs: torch.Tensor = self.head(self.expectation(observations))
        return outputs

    def expectation(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to `<Z>` of every qubit (B, features)."""
        scale = self.log_scale.exp().reshape(self._layers, self._qubits)
        x = torch.arctan(observations[:, None, :] * scale).to(scale.dtype)  # (B, layers, qubits)
        trained = _rz_ry(self.theta[..., 0], self.theta[..., 1])  # (layers + 1, qubits, 2, 2)
        # Encoding and trained gates after a layer's ring form one matrix per qubit.
        between = trained[1:] @ _rz_ry(x, x)  # (B, layers, qubits, 2, 2)
        left = _kronecker(between[:, :, : self._left])
        right = _kronecker(between[:, :, self._left :]).mT
        # The state as a matrix, (B, states of the left qubits, states of the right ones).
        first = trained[0, :, :, 0]
        state = torch.outer(_product(first[: self._left]), _product(first[self._left :]))
        for layer in range(self._layers):
            state = left[:, layer] @ (state * self._entangle) @ right[:, layer]
        probabilities = (state.real**2 + state.imag**2).flatten(1)
        return probabilities @ self._signs


def _rz_ry(y: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
    """Rz(z) Ry(y) as matrices (..., 2, 2)."""
    cos, sin = torch.cos(y / 2), torch.sin(y / 2)
    phase = torch.polar(torch.ones_like(z), z / 2)
    upper = torch.stack([cos, -sin], dim=-1) * phase.conj()[..., None]
    lower = torch.stack([sin, cos], dim=-1) * phase[..., None]
    return torch.stack([upper, lower], dim=-2)


def _kronecker(matrices: torch.Tensor) -> torch.Tensor:
    """The Kronecker product over the third axis from the end: (..., n, 2, 2) to (..., 2^n, 2^n)."""
    *batch, count, _, _ = matrices.shape
    product = torch.ones((*batch, 1, 1), dtype=matrices.dtype)
    for index in range(count):
        part = matrices[..., index, :, :]
        product = product[..., :, None, :, None] * part[..., None, :, None, :]
        product = product.flatten(-4, -3).flatten(-2, -1)
    return product


def _product(states: torch.Tensor) -> torch.Tensor:
    """The product state of n qubits, (n, 2) to (2^n,)."""
    product = torch.ones(1, dtype=states.dtype)
    for state in states:
        product = torch.outer(product, state).flatten()
    return product
