"""Normalises observations by their running mean and standard deviation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from gymnasium.wrappers.utils import RunningMeanStd
from numpy.typing import NDArray

from qcompile.arrays import FloatArray
from qcompile.errors import TrainingError
from qcompile.policy import AnyPolicy, Network

LEAST_STD, ROUNDING = 1e-6, 1e-8
"""A feature counts as constant, and is divided by 1, if its standard deviation is at most LEAST_STD
+ ROUNDING |mean|."""


class Normaliser:
    """Maps observations to (observation - mean) / std for each feature, in float64.

    Both statistics cover all observations learned from. They change only between rollouts, so a
    rollout is learned from with the statistics it was collected with. The actor stores these in the
    buffers `observation_mean` and `observation_std`, which are saved and deployed with it.
    """

    def __init__(self, actor: torch.nn.Module, features: int):
        self._actor = actor
        make: Any = RunningMeanStd
        self._running = make(epsilon=0.0, shape=(features,))
        self._mean, self._std = torch.zeros(features).double(), torch.ones(features).double()
        self.store_statistics()

    def __call__(self, observations: torch.Tensor) -> torch.Tensor:
        """Normalise observations (..., features) as during the current rollout."""
        return (observations - self._mean) / self._std

    def store_statistics(self) -> None:
        """Store the statistics of the last rollout in the actor."""
        self._actor.register_buffer("observation_mean", self._mean.clone())
        self._actor.register_buffer("observation_std", self._std.clone())

    def add(self, observations: NDArray[np.floating]) -> None:
        """Add observations (steps, environments, features) to the next rollout's statistics."""
        self._running.update(observations.reshape(-1, observations.shape[-1]).astype(np.float64))
        self._follow()

    def _follow(self) -> None:
        mean, std = self._running.mean, np.sqrt(self._running.var)
        constant = std <= LEAST_STD + ROUNDING * np.abs(mean)
        self._mean = torch.from_numpy(mean.copy())
        self._std = torch.from_numpy(np.where(constant, 1.0, std))

    @property
    def statistics(self) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation, (features,) each, stored in the actor."""
        names = ("observation_mean", "observation_std")
        mean, std = (self._actor.get_buffer(name).numpy().copy() for name in names)
        return mean, std

    def deployed(self, policy: AnyPolicy) -> AnyPolicy:
        """The policy of the actor, with the stored statistics."""
        mean, std = self.statistics
        if isinstance(policy, Network):
            return replace(policy, mean=mean, std=std)
        return replace(policy, encoder=replace(policy.encoder, mean=mean, std=std))

    def state(self) -> dict[str, Any]:
        """The state for `restore`, without the actor's buffers."""
        running = self._running
        return {
            "count": float(running.count),
            "mean": running.mean.tolist(),
            "var": running.var.tolist(),
        }

    def restore(self, state: dict[str, Any] | None) -> None:
        """Resume from `state`.

        Raises:
            TrainingError: the state has the wrong shape.
        """
        shape = self._running.mean.shape
        if state is None or {np.shape(state[name]) for name in ("mean", "var")} != {shape}:
            raise TrainingError("The mean and variance do not fit the observations.")
        self._running.mean, self._running.var = np.array(state["mean"]), np.array(state["var"])
        self._running.count = state["count"]
        if self._running.count:
            self._follow()
