"""The final model of a training: an average over its updates, weighted towards later ones.

Late in a training the parameters still fluctuate around a limit. Their average is closer to it.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import torch

from qcompile.rl.models import Model


class Average:
    """The running average of a model's trained parameters, kept in `copy`, a model of its shape.

    After update t the average moves by the fraction 1 / (1 + share (t - 1)) towards the parameters,
    so that update s of t has a weight of about (s / t)^(1 / share - 1): with a share of 1 it is the
    mean over all updates, with 0.1 the mean age is 9 % of the training. It does not depend on where
    the training stops. Source: arXiv 1212.1824, polynomial decay.
    """

    def __init__(self, model: Model, copy: Model, share: float):
        self.model = copy
        self.model.load_state_dict(model.state_dict())
        self._share = share
        self._updates = 0

    def add(self, model: Model) -> None:
        """Include the parameters of `model` after an update."""
        rate = 1 / (1 + self._share * self._updates)
        self._updates += 1
        with torch.no_grad():
            for mean, now in zip(self.model.parameters(), model.parameters(), strict=True):
                mean.lerp_(now, rate)

    def state(self) -> dict[str, Any]:
        """The state for `restore`."""
        return {"updates": self._updates, "model": deepcopy(self.model.state_dict())}

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from `state`."""
        self._updates = state["updates"]
        self.model.load_state_dict(state["model"])
