"""Counts of the outcomes of several qubits, as binomial quantiles down a tree."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from qcompile.arrays import CountArray, FloatArray
from qcompile.streams.stream import Stream


def outcome_counts(
    stream: Stream,
    shots: ArrayLike,
    p: FloatArray,
    episode: ArrayLike,
    decision: ArrayLike,
    first_index: ArrayLike = 0,
) -> CountArray:
    """How many of `shots` shots give each outcome of probability `p`, (..., 2**w) to (..., 2**w).

    A multinomial draw: the shots are divided by the first qubit, each part by the second, and so
    on, and each division is the binomial quantile of one uniform number. Those are keyed by
    episodes and decisions, and numbered from `first_index`; 2**w - 1 are used. All of these and
    `shots` are integers that broadcast to (...,).
    """
    from scipy.stats import binom

    p = np.clip(p, 0.0, None)
    *places, outcomes = p.shape
    episode, decision, index = (np.asarray(a)[..., None] for a in (episode, decision, first_index))
    counts = np.broadcast_to(np.asarray(shots)[..., None], (*places, 1)).astype(np.int64)
    while counts.shape[-1] < outcomes:
        parts = counts.shape[-1]
        halves = p.reshape(*places, parts, 2, -1).sum(axis=-1)
        whole = halves.sum(axis=-1)
        share = np.divide(halves[..., 0], whole, out=np.zeros_like(whole), where=whole > 0)
        uniform = stream.uniforms(episode, decision, index + np.arange(parts))
        first = binom.ppf(uniform, counts, np.minimum(share, 1.0)).astype(np.int64)
        counts = np.stack([first, counts - first], axis=-1).reshape(*places, 2 * parts)
        index = index + parts
    return counts
