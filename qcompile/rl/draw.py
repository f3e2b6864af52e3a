"""Actions of a model in training, drawn from the softmax of its outputs."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray, IntArray


def draw_actions(logits: FloatArray, rng: np.random.Generator) -> IntArray:
    """One action for each row of logits (B, actions), distributed as their softmax.

    The largest of logits plus Gumbel noise is distributed so.
    """
    return np.asarray((logits + rng.gumbel(size=logits.shape)).argmax(axis=1))
