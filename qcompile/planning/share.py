"""What is left of a policy's reward: (R - R_random) / (R_ideal - R_random)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.errors import OptionError

_LEAST_ERRORS = 3.0
"""Standard errors that the ideal lies above random actions at least, or no share means anything."""
_NORMAL = 1.96


@dataclass(frozen=True, eq=False)
class Baseline:
    """The rewards that a share is counted between: of random actions, and ideal, without noise.

    `ideal` are rewards of the same resets as those that are judged.

    Raises:
        OptionError: the ideal is not above random actions, or hardly.
    """

    random: FloatArray
    ideal: FloatArray

    def __post_init__(self) -> None:
        error = np.sqrt(_variance_of_mean(self.random) + _variance_of_mean(self.ideal))
        if not self.gap > _LEAST_ERRORS * error:
            raise OptionError(
                f"Without noise the mean reward is {self.ideal.mean():.4g}, with random actions "
                f"{self.random.mean():.4g}: there is nothing to keep.",
                "Settings are judged by the share of this difference that they keep. "
                "Train the policy further, or choose shots yourself.",
            )

    @property
    def gap(self) -> float:
        """What the policy earns over random actions without noise."""
        return float(self.ideal.mean() - self.random.mean())

    def share(self, rewards: FloatArray) -> float:
        """The share of the gap that is left with these rewards, of the ideal's resets."""
        return float(rewards.mean() - self.random.mean()) / self.gap

    def share_95(self, rewards: FloatArray) -> tuple[float, float]:
        """Its 95 % interval, to first order; rewards of the same reset are compared."""
        share = self.share(rewards)
        variance = _variance_of_mean(rewards - share * self.ideal)
        variance += (1 - share) ** 2 * _variance_of_mean(self.random)
        error = _NORMAL * float(np.sqrt(variance)) / self.gap
        return share - error, share + error


def _variance_of_mean(values: FloatArray) -> float:
    """That of the mean of values (n,)."""
    return float(values.var(ddof=1) / len(values)) if len(values) > 1 else 0.0
