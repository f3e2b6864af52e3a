"""Trainable models in torch: the circuits are evaluated by the same code as in numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import LAYOUTS
from qcompile.rl.presets import Settings
from qcompile.simulate import Simulator


class SVQC(torch.nn.Module):
    """Single-qubit variational circuits and a linear layer: observations to outputs.

    The expectations y of n circuits are copied `reuse` times (output reuse) before the linear
    layer. Source: arXiv 2203.14348.
    """

    def __init__(self, features: int, outputs: int, settings: Settings, generator: torch.Generator):
        super().__init__()
        copies, reuse = len(settings.scales), settings.reuse
        self.program, feature = LAYOUTS[settings.layout](features, copies)
        self._feature = torch.tensor(feature)
        self._reuse = reuse
        self._simulator = Simulator(self.program, torch, torch.float32)
        scale = torch.tensor(settings.scales).repeat_interleave(len(feature) // copies)
        self.log_scale = torch.nn.Parameter(scale.log(), requires_grad=settings.trainable_scale)
        spread = torch.rand(len(self.program.parameters), generator=generator) - 0.5
        self.theta = torch.nn.Parameter(settings.theta_spread_rad * spread)
        columns = len(self.program) * reuse
        if settings.weight_spread is None:  # Glorot
            limit = (6 / (columns + outputs)) ** 0.5
            weights = limit * (2 * torch.rand(outputs, columns, generator=generator) - 1)
        else:
            weights = settings.weight_spread * torch.randn(outputs, columns, generator=generator)
        self.weights = torch.nn.Parameter(weights)
        self.bias = torch.nn.Parameter(torch.zeros(outputs))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to outputs (B, outputs)."""
        x = torch.arctan(observations[:, self._feature] * self.log_scale.exp())
        y = self._simulator.expectation(x, self.theta)
        folded = self.weights.reshape(len(self.bias), self._reuse, -1).sum(dim=1)
        outputs: torch.Tensor = y @ folded.T + self.bias
        return outputs

    def policy(self, name: str, environment: str, metadata: dict[str, Any]) -> Policy:
        """The policy to deploy: numbers in double precision, output reuse folded."""

        def numbers(tensor: torch.Tensor) -> np.ndarray[Any, Any]:
            return tensor.detach().double().numpy().copy()

        encoder = Encoder("arctan", self._feature.numpy().copy(), numbers(self.log_scale.exp()))
        return Policy(
            name,
            environment,
            encoder,
            self.program,
            numbers(self.theta),
            numbers(self.weights),
            numbers(self.bias),
            self._reuse,
            metadata,
        ).folded()
