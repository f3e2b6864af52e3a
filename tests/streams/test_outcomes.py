"""Counts of outcomes: multinomial, keyed by their place, and one binomial for one qubit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qcompile.streams import Stream
from qcompile.streams.outcomes import outcome_counts

P = np.array([0.4, 0.0, 0.25, 0.05, 0.1, 0.1, 0.1, 0.0])


def test_the_counts_are_multinomial() -> None:
    """Means, variances and covariances of 20,000 draws of 50 shots."""
    rows = 20_000
    p = np.tile(P, (rows, 1))
    counts = outcome_counts(Stream(3, "outcomes"), 50, p, np.arange(rows), np.zeros(rows, int))
    assert (counts.sum(axis=1) == 50).all()
    assert not counts[:, P == 0].any()
    np.testing.assert_allclose(counts.mean(axis=0), 50 * P, atol=0.1)
    wanted = 50 * (np.diag(P) - np.outer(P, P))
    np.testing.assert_allclose(np.cov(counts.T), wanted, atol=0.35)
    found = np.bincount(counts[:, 4], minlength=51)[:16]
    expected = rows * stats.binom.pmf(np.arange(16), 50, 0.1)
    kept = expected > 5
    chi_square = ((found - expected) ** 2 / expected)[kept].sum()
    assert stats.chi2.sf(chi_square, kept.sum() - 1) > 1e-3


def test_a_draw_depends_on_its_place_alone() -> None:
    p = np.tile(P, (6, 1))
    episode, decision = np.array([0, 1, 2, 0, 1, 2]), np.array([5, 5, 5, 6, 6, 6])
    stream = Stream(3, "outcomes")
    together = outcome_counts(stream, 1000, p, episode, decision)
    alone = outcome_counts(stream, 1000, p[:1], np.array([1]), np.array([6]))
    np.testing.assert_array_equal(together[4], alone[0])
    assert len({row.tobytes() for row in together}) == 6
    other = outcome_counts(stream, 1000, p, episode, decision, first_index=7)
    assert (other != together).any()


@pytest.mark.parametrize("p_one", [0.0, 0.3, 1.0])
def test_one_qubit_is_a_binomial_quantile(p_one: float) -> None:
    p = np.array([[1 - p_one, p_one]])
    place = np.array([4]), np.array([2])
    (counts,) = outcome_counts(Stream(1, "outcomes"), 77, p, *place)
    u = Stream(1, "outcomes").uniforms(*place)
    assert counts[0] == stats.binom.ppf(u, 77, 1 - p_one)[0]


def test_rounding_beyond_zero_and_one_does_no_harm() -> None:
    p = np.array([[1.0 + 1e-16, -1e-16, 0.0, 0.0]])
    counts = outcome_counts(Stream(1, "outcomes"), 10, p, np.array([0]), np.array([0]))
    assert counts.tolist() == [[10, 0, 0, 0]]
