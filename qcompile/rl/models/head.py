"""Shared parts of the circuit models: input scales and a linear layer with output reuse."""

from __future__ import annotations

import torch

from qcompile.errors import TrainingError
from qcompile.rl.settings import Settings


def log_scales(settings: Settings, columns: int) -> torch.Tensor:
    """The logarithms of the input scales, copy by copy, with `columns` in each.

    Raises:
        TrainingError: a copy has the wrong number of scales.
    """
    rows = []
    for scale in settings.scales:
        row = torch.tensor(scale, dtype=torch.float32)
        if row.ndim and len(row) != columns:
            raise TrainingError(
                f"A copy has {len(row)} scales for {columns} features.",
                "Give one number per copy, or one per feature.",
            )
        rows.append(row.expand(columns))
    return torch.cat(rows).log()


def input_scale(settings: Settings, columns: int) -> torch.nn.Parameter:
    """`log_scales` as a parameter, trained if the settings say so."""
    return torch.nn.Parameter(log_scales(settings, columns), settings.trainable_scale)


def first_theta(
    settings: Settings, shape: tuple[int, ...], generator: torch.Generator
) -> torch.nn.Parameter:
    """The initial theta, uniform in an interval around 0."""
    spread = torch.rand(shape, generator=generator) - 0.5
    return torch.nn.Parameter(settings.theta_spread_rad * spread)


class ReusedLinear(torch.nn.Module):
    """A linear layer that reads each of n values `reuse` times (output reuse).

    `forward` folds the copies by summing their weights. Source: arXiv 2203.14348.
    """

    def __init__(self, values: int, outputs: int, settings: Settings, generator: torch.Generator):
        super().__init__()
        self.reuse = settings.reuse
        columns = values * settings.reuse
        if settings.weight_spread is None:  # Glorot
            limit = (6 / (columns + outputs)) ** 0.5
            weights = limit * (2 * torch.rand(outputs, columns, generator=generator) - 1)
        else:
            weights = settings.weight_spread * torch.randn(outputs, columns, generator=generator)
        self.weights = torch.nn.Parameter(weights)
        self.bias = torch.nn.Parameter(torch.zeros(outputs))

    def start(self, weights: torch.Tensor, bias: torch.Tensor) -> None:
        """Start from weights (outputs, values), with values read once, and bias (outputs,)."""
        with torch.no_grad():
            self.weights.copy_(weights.repeat(1, self.reuse) / self.reuse)
            self.bias.copy_(bias)

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """Values (B, values) to outputs (B, outputs)."""
        folded: torch.Tensor = self.weights
        if self.reuse > 1:
            folded = folded.reshape(len(self.bias), self.reuse, -1).sum(dim=1)
        return torch.nn.functional.linear(values, folded, self.bias)
