"""The softmax of a model's outputs in training: drawing actions, and entropy."""

from __future__ import annotations

import numpy as np
import torch

from qcompile.arrays import FloatArray, IntArray


def draw_actions(logits: FloatArray, rng: np.random.Generator) -> IntArray:
    """One action for each row of logits (B, actions), distributed as its softmax.

    This is the argmax of logits plus Gumbel noise.
    """
    return np.asarray((logits + rng.gumbel(size=logits.shape)).argmax(axis=1))


def mean_entropy(outputs: torch.Tensor) -> torch.Tensor:
    """The mean entropy in nats of the softmax of outputs (B, actions)."""
    log_all = torch.log_softmax(outputs, dim=1)
    return -(log_all.exp() * log_all).sum(dim=1).mean()
