"""What a sample of episodes says of the mean reward, and what it cannot say."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

_BLOCK = 1_000_000
_PERCENT = (2.5, 97.5)
_MOST_PARTS = 20


def bootstrap_ci95(
    rewards: NDArray[np.float64], seed: int, resamples: int = 10_000
) -> list[float] | None:
    """The 95 % interval [low, high] of the mean of rewards (n,); None below two of them.

    Each end is the farther one of two: that of Student's t, and that of the studentised bootstrap,
    which follows a skewed law. The variance of a resample counts as 1/n of the sample's at least,
    1/20 above 20 rewards: where one reward is unlike the others a resample without it has hardly
    any. With 1/20 the interval then ends about where Poisson's law for that one has it. Equal
    rewards give an interval without width: see `unseen_share`. docs/evaluate.md measures how often
    it holds the mean. Source: Efron and Tibshirani, An Introduction to the Bootstrap, chapter 12.
    """
    count = len(rewards)
    if count < 2:
        return None
    if np.ptp(rewards) == 0:
        return [float(rewards[0])] * 2
    mean, variance = rewards.mean(), rewards.var(ddof=1)
    error, least = np.sqrt(variance / count), variance / min(count, _MOST_PARTS)
    rng = np.random.default_rng(seed)
    pulls = []
    for block in np.array_split(np.empty(resamples), -(-resamples * count // _BLOCK)):
        drawn = rng.choice(rewards, (len(block), count))
        spread = np.maximum(drawn.var(axis=1, ddof=1), least)
        pulls.append((drawn.mean(axis=1) - mean) / np.sqrt(spread / count))
    lowest, highest = np.percentile(np.concatenate(pulls), _PERCENT)
    student = stdtrit(count - 1, 0.975)
    return [
        float(mean - max(highest, student) * error),
        float(mean - min(lowest, -student) * error),
    ]


def unseen_share(count: int) -> float:
    """The share of episodes unlike them that `count` equal ones leave possible, at 95 %.

    Were more of them different, so many equal ones in a row would come less than once in twenty.
    """
    return float(1 - 0.05 ** (1 / count))
