"""The model that a training hands over: an average over its updates, the later ones weighing more.

Late in a training the numbers still swing about what they come to. Their average is nearer to it
than any of them.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import torch


class Average:
    """The running average of the trained numbers of a model, in its `twin`, one of its shape.

    The average moves by 1 / (1 + share (t - 1)) of the way to the numbers after update t, so that
    update s of t weighs about (s / t)^(1 / share - 1): with a share of 1 it is the mean over all
    updates, with 0.1 their mean age is 9 % of the training. Where the training stops makes no
    difference. Source: arXiv 1212.1824, polynomial decay.
    """

    def __init__(self, model: torch.nn.Module, twin: torch.nn.Module, share: float):
        self.model = twin
        self.model.load_state_dict(model.state_dict())
        self._share = share
        self._updates = 0

    def add(self, model: torch.nn.Module) -> None:
        """Take in the numbers of `model` after an update."""
        rate = 1 / (1 + self._share * self._updates)
        self._updates += 1
        with torch.no_grad():
            for mean, now in zip(self.model.parameters(), model.parameters(), strict=True):
                mean.lerp_(now, rate)

    def state(self) -> dict[str, Any]:
        """What `restore` takes."""
        return {"updates": self._updates, "model": deepcopy(self.model.state_dict())}

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from `state`."""
        self._updates = state["updates"]
        self.model.load_state_dict(state["model"])
