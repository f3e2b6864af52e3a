"""The classical model equivalent to the paper's circuits, trained directly."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch

from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import parallel
from qcompile.rl.models.circuits import numbers
from qcompile.rl.models.head import ReusedLinear, input_scale
from qcompile.rl.settings import Settings


class SurrogateModel(torch.nn.Module):
    """A linear layer on the functions that h ry(x) rz(x) ry(theta) can produce, without theta.

    With x = arctan(u) its `<Z>` is -sin(x) cos(theta) - cos(x)^2 sin(theta), so any theta mixes
    sin(x) = u / sqrt(1 + u^2) and cos(x)^2 = 1 / (1 + u^2): two fixed functions of a feature.
    """

    def __init__(self, features: int, outputs: int, settings: Settings, generator: torch.Generator):
        super().__init__()
        copies = len(settings.scales)
        _, feature = parallel(features, copies)
        self.register_buffer("feature", torch.tensor(feature), persistent=False)
        self.feature: torch.Tensor
        self.log_scale = input_scale(settings, features)
        self.head = ReusedLinear(2 * len(feature), outputs, settings, generator)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to outputs (B, outputs)."""
        u = observations.index_select(1, self.feature) * self.log_scale.exp()
        cosine = torch.rsqrt(u * u + 1)
        values = torch.cat([u * cosine, cosine * cosine], dim=1)
        outputs: torch.Tensor = self.head(values.to(self.log_scale.dtype))
        return outputs

    def policy(self, name: str, environment: str, metadata: dict[str, Any]) -> Policy:
        """An equal policy of circuits: theta = pi gives sin(x), theta = -pi / 2 gives cos(x)^2."""
        count = len(self.feature)
        program, _ = parallel(count, 2)
        scale = np.tile(numbers(self.log_scale.exp()), 2)
        columns = np.tile(self.feature.numpy(), 2)
        return Policy(
            name,
            environment,
            Encoder("arctan", columns, scale),
            program,
            np.repeat([math.pi, -math.pi / 2], count),
            numbers(self.head.weights),
            numbers(self.head.bias),
            self.head.reuse,
            metadata,
        ).folded()
