"""The share of a policy's reward that is kept: (R - R_random) / (R_ideal - R_random)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.errors import OptionError

_MIN_ERRORS = 3.0
"""The least gap between ideal and random rewards, in standard errors, for a meaningful share."""
_NORMAL = 1.96


@dataclass(frozen=True, eq=False)
class Baseline:
    """The rewards that define shares 0 and 1: of random actions, and ideal without noise.

    `ideal` has the same resets as the rewards that are evaluated.

    Raises:
        OptionError: the ideal reward is not clearly above random actions.
    """

    random: FloatArray
    ideal: FloatArray

    def __post_init__(self) -> None:
        error = np.sqrt(_variance_of_mean(self.random) + _variance_of_mean(self.ideal))
        if not self.gap > _MIN_ERRORS * error:
            raise OptionError(
                f"Without noise the mean reward is {self.ideal.mean():.4g}, with random actions "
                f"{self.random.mean():.4g}: there is nothing to keep.",
                "Settings are ranked by the share of this difference that they keep. "
                "Train the policy further, or choose shots yourself.",
            )

    @property
    def gap(self) -> float:
        """The noiseless gain of the policy over random actions."""
        return float(self.ideal.mean() - self.random.mean())

    def share(self, rewards: FloatArray) -> float:
        """The share of the gap that these rewards keep; they have the ideal's resets."""
        return float(rewards.mean() - self.random.mean()) / self.gap

    def share_95(self, rewards: FloatArray) -> tuple[float, float]:
        """The 95 % interval of the share, to first order; rewards are paired by reset."""
        share = self.share(rewards)
        variance = _variance_of_mean(rewards - share * self.ideal)
        variance += (1 - share) ** 2 * _variance_of_mean(self.random)
        error = _NORMAL * float(np.sqrt(variance)) / self.gap
        return share - error, share + error


def _variance_of_mean(values: FloatArray) -> float:
    """The variance of the mean of values (n,)."""
    return float(values.var(ddof=1) / len(values)) if len(values) > 1 else 0.0
