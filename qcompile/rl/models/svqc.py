"""The policy of single-qubit circuits: evaluated by the same code as in numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from qcompile.policy import Encoder, Policy
from qcompile.policy.layouts import LAYOUTS
from qcompile.rl.models.head import ReusedLinear, first_theta, input_scale
from qcompile.rl.settings import Settings
from qcompile.simulate import Simulator


class SVQC(torch.nn.Module):
    """Single-qubit variational circuits and a linear layer: observations to outputs.

    Source: arXiv 2203.14348.
    """

    def __init__(self, features: int, outputs: int, settings: Settings, generator: torch.Generator):
        super().__init__()
        copies = len(settings.scales)
        self.program, feature = LAYOUTS[settings.layout](features, copies)
        self.register_buffer("feature", torch.tensor(feature), persistent=False)
        self.feature: torch.Tensor
        self._simulator = Simulator(self.program, torch, torch.float32)
        self.log_scale = input_scale(settings, len(feature) // copies)
        self.theta = first_theta(settings, (len(self.program.parameters),), generator)
        self.head = ReusedLinear(len(self.program), outputs, settings, generator)

    def inputs(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to the inputs x of the circuits (B, inputs), in radians.

        Observations in double precision are encoded in it, as the deployed policy does.
        """
        scaled = observations.index_select(1, self.feature) * self.log_scale.exp()
        return torch.arctan(scaled).to(self.theta.dtype)

    def expectation(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to the ideal `<Z>` of every circuit (B, circuits)."""
        z: torch.Tensor = self._simulator.expectation(self.inputs(observations), self.theta)
        return z

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (B, features) to outputs (B, outputs)."""
        outputs: torch.Tensor = self.head(self.expectation(observations))
        return outputs

    def policy(self, name: str, environment: str, metadata: dict[str, Any]) -> Policy:
        """The policy to deploy: numbers in double precision, output reuse folded."""
        encoder = Encoder("arctan", self.feature.numpy().copy(), numbers(self.log_scale.exp()))
        return Policy(
            name,
            environment,
            encoder,
            self.program,
            numbers(self.theta),
            numbers(self.head.weights),
            numbers(self.head.bias),
            self.head.reuse,
            metadata,
        ).folded()


def numbers(tensor: torch.Tensor) -> np.ndarray[Any, Any]:
    """The numbers of a tensor in double precision."""
    return tensor.detach().double().numpy().copy()
