"""Training under a device's noise: actions depend on what is measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from qcompile.deploy.measurement import Measurement
from qcompile.deploy.settings import RunSettings
from qcompile.device import load_device
from qcompile.execution import OfflineExecutor
from qcompile.rl.models import CircuitModel
from qcompile.rl.models.circuits import numbers
from qcompile.rl.settings import Settings


class ActingNoise:
    """Measures the actor's circuits on a device while it acts, and passes the noise to the update.

    The residual of a step is the measured `<O>` minus the ideal one. The update adds it to the
    ideal `<O>` of the current parameters. So before the first gradient step the probabilities equal
    those that the actions were drawn from, and gradients flow through the ideal circuit.
    """

    def __init__(self, actor: CircuitModel, settings: Settings, seed: np.random.SeedSequence):
        self._actor, self.observables = actor, len(actor.program.measured)
        self._executor = OfflineExecutor(load_device(settings.backend), seed)
        self._measure = Measurement(
            actor.program,
            self._executor,
            RunSettings(shots=settings.shots, mitigation=settings.mitigation).resolved(
                self._executor.device
            ),
        )
        self._residuals: list[torch.Tensor] = []

    def act(self, observations: torch.Tensor) -> torch.Tensor:
        """Outputs (B, actions) from the measured `<O>` for observations (B, features)."""
        ideal = self._actor.expectation(observations)
        x = numbers(self._actor.inputs(observations))
        measured = self._measure(x, numbers(self._actor.theta))
        residual = torch.from_numpy(measured).float() - ideal
        self._residuals.append(residual)
        outputs: torch.Tensor = self._actor.head(ideal + residual)
        return outputs

    def outputs(self, observations: torch.Tensor, residual: torch.Tensor) -> torch.Tensor:
        """Outputs (B, actions) with the noise `residual` (B, observables)."""
        outputs: torch.Tensor = self._actor.head(self._actor.expectation(observations) + residual)
        return outputs

    def take_residuals(self) -> torch.Tensor:
        """The residuals of the steps since the last call, (steps * environments, observables)."""
        residuals = torch.cat(self._residuals)
        self._residuals.clear()
        return residuals

    def state(self) -> dict[str, Any]:
        """The state for `restore`, taken between two rollouts."""
        return dict(self._executor.rng.bit_generator.state)

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from `state`."""
        self._executor.rng.bit_generator.state = state
