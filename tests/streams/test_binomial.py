"""Counts have binomial frequencies and moments, and increase with their probability."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qcompile.streams import Stream

LAWS = [
    *((shots, p) for shots in (1, 16, 32, 1024, 8192) for p in (1e-4, 0.003, 0.5, 0.98)),
    *((64, 0.5), (65, 0.5), (65, 0.16), (1024, 0.0156), (1024, 0.0157), (100, 0.7)),
    *((100_000, 0.3), (10_000_000, 2e-6), (10_000_000, 0.6)),
]
"""Shots and probability on both sides of the borders between methods."""


def sample(shots: int, p: float, episodes: int, seed: int) -> np.ndarray:
    """Counts of 40 circuits, (40 * episodes,)."""
    where, chances = np.arange(episodes), np.full((episodes, 40), p)
    return Stream(seed, "shots").binomial(shots, chances, where, where).ravel()


def surprise(counts: np.ndarray, shots: int, p: float) -> float:
    """The chance of a larger chi-square, over cells of at least ten expected counts."""
    law = stats.binom(shots, p)
    edges = np.unique(law.ppf(np.linspace(0.0, 1.0, 202)[1:-1]))  # a cell ends at its edge
    expected = counts.size * np.diff(law.cdf(edges), prepend=0.0, append=1.0)
    observed = np.bincount(np.searchsorted(edges, counts), minlength=len(expected))
    rare = expected < 10
    if rare.any():
        expected = np.append(expected[~rare], expected[rare].sum())
        observed = np.append(observed[~rare], observed[rare].sum())
    square = np.sum((observed - expected) ** 2 / np.maximum(expected, 1.0))
    return float(stats.chi2.sf(square, len(expected) - 1))


@pytest.mark.parametrize(("shots", "p"), LAWS)
def test_counts_have_the_frequencies_of_their_law(shots: int, p: float) -> None:
    assert surprise(sample(shots, p, 2500, seed=0), shots, p) > 1e-5


@pytest.mark.parametrize(("shots", "p"), [(64, 0.3), (1024, 0.5), (8192, 0.98)])
def test_frequencies_hold_for_millions(shots: int, p: float) -> None:
    """Three million counts show errors of the expansion that a smaller sample hides."""
    assert surprise(sample(shots, p, 75_000, seed=2), shots, p) > 1e-5


@pytest.mark.parametrize(("shots", "p"), LAWS)
def test_counts_have_the_moments_of_their_law(shots: int, p: float) -> None:
    """Mean and variance within five of their standard errors."""
    counts = sample(shots, p, 2500, seed=1)
    mean, variance, excess = (float(m) for m in stats.binom.stats(shots, p, moments="mvk"))
    assert abs(counts.mean() - mean) <= 5 * np.sqrt(variance / counts.size)
    error = variance * np.sqrt((excess + 2) / counts.size)
    assert abs(((counts - mean) ** 2).mean() - variance) <= 5 * error


def test_certain_outcomes_and_those_beyond_by_rounding() -> None:
    p = np.array([[0.0, -1e-17, 1.0, 1.0 + 2e-16, -0.0]])
    for shots in (0, 1, 64, 1024):
        counts = Stream(0, "shots").binomial(shots, p, [0], [0])
        assert counts.dtype == np.int64
        assert counts.tolist() == [[0, 0, shots, shots, 0]]


@pytest.mark.parametrize("shots", [1, 16, 64, 1024, 100_000])
def test_counts_rise_with_their_probability(shots: int) -> None:
    """At one place: in steps of 1e-3, and from one float to the next."""
    for steps in (np.linspace(0, 1, 1001), 0.3 + np.arange(1001) * 2.0**-54):
        p = np.repeat(steps[:, None], 24, axis=1)
        where = np.full(len(p), 7)
        counts = Stream(0, "shots").binomial(shots, p, where, where)
        assert (np.diff(counts, axis=0) >= 0).all()


@pytest.mark.parametrize("shots", [16, 1024])
def test_nan_has_no_counts(shots: int) -> None:
    with pytest.raises(ValueError, match="not a number"):
        Stream(0, "shots").binomial(shots, np.array([[0.5, np.nan]]), [0], [0])


@pytest.mark.parametrize("shape", [(0, 24), (3, 0)])
def test_nothing_to_draw_gives_nothing(shape: tuple[int, int]) -> None:
    where = np.arange(shape[0])
    assert Stream(0, "shots").binomial(1024, np.zeros(shape), where, where).shape == shape
