"""What a sample of episodes says of the mean reward, and what it cannot say."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray

_MOST_DRAWN = 1_000_000
"""Rewards that are drawn at a time."""
_PERCENT = (2.5, 97.5)
_MOST_PARTS = 20


def bootstrap_ci95(rewards: FloatArray, seed: int, resamples: int = 10_000) -> list[float] | None:
    """The 95 % interval [low, high] of the mean of rewards (n,); None below two of them.

    Each end is the farther one of two: that of Student's t, and that of the studentised bootstrap,
    which follows a skewed law. The variance of a resample counts as 1/n of the sample's at least,
    1/20 above 20 rewards: where one reward is unlike the others a resample without it has hardly
    any. With 1/20 the interval then ends about where Poisson's law for that one has it. Equal
    rewards give an interval without width: see `unseen_share`. docs/howto/evaluate.md measures
    how often it holds the mean. Source: Efron and Tibshirani, An Introduction to the Bootstrap,
    chapter 12.
    """
    count = len(rewards)
    if count < 2:
        return None
    if np.ptp(rewards) == 0:
        return [float(rewards[0])] * 2
    from scipy.stats import bootstrap, t

    mean, variance = rewards.mean(), rewards.var(ddof=1)
    error, least = np.sqrt(variance / count), variance / min(count, _MOST_PARTS)

    def pull(drawn: FloatArray, axis: int) -> FloatArray:
        """How far the mean of each resample is off, in its standard errors."""
        spread = np.maximum(drawn.var(axis=axis, ddof=1), least)
        return np.asarray((drawn.mean(axis=axis) - mean) / np.sqrt(spread / count))

    pulls = bootstrap(
        (rewards,),
        pull,
        n_resamples=resamples,
        batch=max(_MOST_DRAWN // count, 1),
        method="percentile",
        rng=np.random.default_rng(seed),
    ).bootstrap_distribution
    lowest, highest = np.percentile(pulls, _PERCENT)
    student = t.ppf(0.975, count - 1)
    return [
        float(mean - max(highest, student) * error),
        float(mean - min(lowest, -student) * error),
    ]


def unseen_share(count: int) -> float:
    """The share of episodes unlike them that `count` equal ones leave possible, at 95 %.

    Were more of them different, so many equal ones in a row would come less than once in twenty.
    """
    return float(1 - 0.05 ** (1 / count))
