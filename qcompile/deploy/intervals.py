"""Confidence intervals of the mean reward of a sample of episodes."""

from __future__ import annotations

import numpy as np

from qcompile.arrays import FloatArray

_MAX_DRAWN = 1_000_000
"""Rewards drawn at a time."""
_PERCENT = (2.5, 97.5)
_MAX_PARTS = 20


def bootstrap_ci95(rewards: FloatArray, seed: int, resamples: int = 10_000) -> list[float] | None:
    """The 95 % interval [low, high] of the mean of rewards (n,); None below two of them.

    Each end is the wider of two: Student's t, and the studentised bootstrap, which follows a skewed
    distribution. The variance of a resample is at least 1/n of the sample's, 1/20 above 20 rewards:
    if one reward is an outlier, a resample without it has hardly any variance. With 1/20 the
    interval then ends about where a Poisson law for the outlier puts it. Equal rewards give an
    interval of zero width: see `unseen_share`. docs/howto/evaluate.md measures its coverage.
    Source: Efron and Tibshirani, An Introduction to the Bootstrap, chapter 12.
    """
    count = len(rewards)
    if count < 2:
        return None
    if np.ptp(rewards) == 0:
        return [float(rewards[0])] * 2
    from scipy.stats import bootstrap, t

    mean, variance = rewards.mean(), rewards.var(ddof=1)
    error, least = np.sqrt(variance / count), variance / min(count, _MAX_PARTS)

    def pull(drawn: FloatArray, axis: int) -> FloatArray:
        """The deviation of each resample's mean, in its standard errors."""
        spread = np.maximum(drawn.var(axis=axis, ddof=1), least)
        return np.asarray((drawn.mean(axis=axis) - mean) / np.sqrt(spread / count))

    pulls = bootstrap(
        (rewards,),
        pull,
        n_resamples=resamples,
        batch=max(_MAX_DRAWN // count, 1),
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
    """The upper 95 % bound on the share of different episodes, after `count` equal ones.

    If more were different, `count` equal ones in a row would occur less than once in twenty.
    """
    return float(1 - 0.05 ** (1 / count))
