"""Observations in units of their running mean and standard deviation."""

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
"""A feature is constant, and divided by 1, where its standard deviation is at most
LEAST_STD + ROUNDING |mean|."""


class Normaliser:
    """Gives observations to the models as (observation - mean) / std of each feature, in float64.

    Both follow all observations that were learned from. They change between two rollouts alone, so
    a rollout is learned from with the numbers that it was collected with. The actor keeps those as
    buffers, `observation_mean` and `observation_std`: they are saved, and deployed, with it.
    """

    def __init__(self, actor: torch.nn.Module, features: int):
        self._actor = actor
        make: Any = RunningMeanStd
        self._seen = make(epsilon=0.0, shape=(features,))
        self._mean, self._std = torch.zeros(features).double(), torch.ones(features).double()
        self.keep()

    def __call__(self, observations: torch.Tensor) -> torch.Tensor:
        """Observations (..., features) as the models see them while a rollout is collected."""
        return (observations - self._mean) / self._std

    def keep(self) -> None:
        """From now on the actor has the numbers that the last rollout was collected with."""
        self._actor.register_buffer("observation_mean", self._mean.clone())
        self._actor.register_buffer("observation_std", self._std.clone())

    def add(self, observations: NDArray[np.floating]) -> None:
        """Count observations (steps, environments, features): the next rollout sees by them."""
        self._seen.update(observations.reshape(-1, observations.shape[-1]).astype(np.float64))
        self._follow()

    def _follow(self) -> None:
        mean, std = self._seen.mean, np.sqrt(self._seen.var)
        constant = std <= LEAST_STD + ROUNDING * np.abs(mean)
        self._mean = torch.from_numpy(mean.copy())
        self._std = torch.from_numpy(np.where(constant, 1.0, std))

    @property
    def kept(self) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation, (features,) each, that the actor has learned with."""
        names = ("observation_mean", "observation_std")
        mean, std = (self._actor.get_buffer(name).numpy().copy() for name in names)
        return mean, std

    def deployed(self, policy: AnyPolicy) -> AnyPolicy:
        """The policy of the actor, which then normalises as it has learned to."""
        mean, std = self.kept
        if isinstance(policy, Network):
            return replace(policy, mean=mean, std=std)
        return replace(policy, encoder=replace(policy.encoder, mean=mean, std=std))

    def state(self) -> dict[str, Any]:
        """What `restore` takes, beside the actor's buffers."""
        seen = self._seen
        return {"count": float(seen.count), "mean": seen.mean.tolist(), "var": seen.var.tolist()}

    def restore(self, state: dict[str, Any] | None) -> None:
        """Resume from `state`.

        Raises:
            TrainingError: it is that of other observations.
        """
        shape = self._seen.mean.shape
        if state is None or {np.shape(state[name]) for name in ("mean", "var")} != {shape}:
            raise TrainingError("The mean and variance of observations do not fit them.")
        self._seen.mean, self._seen.var = np.array(state["mean"]), np.array(state["var"])
        self._seen.count = state["count"]
        if self._seen.count:
            self._follow()
