"""The expansion against exact quantiles, and counts against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special, stats

from qcompile.streams import Stream
from qcompile.streams.quantile import binomial_quantiles, expansion
from qcompile.streams.scores import ARRAYS, polynomials

RNG = np.random.default_rng(11)


def scores_of(shots: int, uniform: np.ndarray) -> np.ndarray:
    scores = np.empty((ARRAYS, *uniform.shape))
    scores[0] = uniform
    polynomials(shots, scores)
    return scores


@pytest.mark.parametrize("shots", [2, 16, 40, 64, 256, 1024, 8192, 100_000, 10_000_000])
def test_the_expansion_errs_by_a_quarter_of_its_bound_at_most(shots: int) -> None:
    """y = k + 1/2 where u = F(k), in the lower tail; those of 1 - p are the upper tails of p."""
    largest = 0.0
    for p in (*np.geomspace(0.45 / shots, 0.5, 40), *(1 - np.geomspace(0.45 / shots, 0.5, 40))):
        spread = np.sqrt(shots * p * (1 - p))
        first = max(0.0, np.floor(shots * p - 9 * spread - 5))
        last = min(shots - 1.0, np.ceil(shots * p + 2))
        k = np.unique(np.rint(np.linspace(first, last, min(1000, int(last - first) + 1))))
        below = special.betaincc(k + 1, shots - k, p)
        k, below = (
            k[(below > 2.0**-54) & (below <= 0.5)],
            below[(below > 2.0**-54) & (below <= 0.5)],
        )
        y, bound = expansion(shots, np.full((1, len(k)), p), scores_of(shots, below[None]))
        errs = np.abs(y - k - 0.5) - 1e-12 - 4e-15 * shots
        largest = max(largest, np.max(errs[bound < 0.5] / bound[bound < 0.5], initial=0.0))
    assert largest <= 0.25


def chances(shots: int, rows: int) -> np.ndarray:
    """Probabilities of all sizes, near 0, near 1 and between, (rows, 12)."""
    small = np.exp(RNG.uniform(np.log(0.01 / shots), np.log(0.9), (rows, 4)))
    return np.hstack([small[:, :2], 1 - small[:, 2:], RNG.uniform(0, 1, (rows, 8))])


SHOTS = [1, 2, 7, 16, 33, 64, 65, 200, 1024, 8192, 65_536, 1_000_000, 10_000_000]


@pytest.mark.parametrize("shots", SHOTS)
def test_counts_are_scipys_quantiles(shots: int) -> None:
    episode, decision = RNG.integers(0, 2**32, 200), RNG.integers(0, 2**32, 200)
    p, stream = chances(shots, 200), Stream(1, "shots")
    uniform = stream.scores(shots, episode, decision, 12)[0]
    counts = stream.binomial(shots, p, episode, decision)
    np.testing.assert_array_equal(counts, stats.binom.ppf(uniform, shots, p))


@pytest.mark.parametrize("shots", SHOTS)
def test_counts_step_where_the_distribution_does(shots: int) -> None:
    """A little below F(k) the count is k, a little above it k + 1, where k has both neighbours."""
    p = chances(shots, 100)
    k = np.minimum(stats.binom.ppf(RNG.uniform(0.01, 0.99, p.shape), shots, p), shots - 1)
    level = special.betaincc(k + 1, shots - k, p)
    step = 1e-9 * np.minimum(level, 1 - level)
    clear = stats.binom.pmf(k, shots, p) > 1e-6
    clear &= stats.binom.pmf(k + 1, shots, p) > 1e-6
    assert clear.mean() > 0.5
    for side, count in ((-1, k), (1, k + 1)):
        counts = binomial_quantiles(shots, p, scores_of(shots, level + side * step))
        np.testing.assert_array_equal(counts[clear], count[clear])


@pytest.mark.parametrize("shots", [7, 33, 100, 1024, 100_000])
def test_counts_of_far_tails(shots: int) -> None:
    """Six to seven standard deviations out, each side measured from its end."""
    p = chances(shots, 50)
    tail = special.ndtr(RNG.uniform(-7, -6, p.shape))
    tail = (np.floor(tail * 2.0**52) * 2 + 1) * 2.0**-53
    low = binomial_quantiles(shots, p, scores_of(shots, tail))
    np.testing.assert_array_equal(low, stats.binom.ppf(tail, shots, p))
    high = binomial_quantiles(shots, p, scores_of(shots, 1 - tail))
    np.testing.assert_array_equal(high, stats.binom.isf(tail, shots, p))
