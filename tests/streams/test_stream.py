"""Streams: their definition in plain integers, repeatability, and independence."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qcompile.streams import Purpose, Stream

MASK = 2**32 - 1
RNG = np.random.default_rng(7)


def words(seed: int, number: int, counter: tuple[int, int, int, int]) -> tuple[int, int]:
    """Philox4x32-10 as the paper writes it, one counter at a time: two numbers of 64 bits."""
    k0, k1 = map(int, np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(2))
    c0, c1, c2, c3 = counter
    for _ in range(10):
        high, low = divmod(0xCD9E8D57 * c2, 2**32)
        high_other, low_other = divmod(0xD2511F53 * c0, 2**32)
        c0, c1, c2, c3 = high ^ c1 ^ k0, low, high_other ^ c3 ^ k1, low_other
        k0, k1 = k0 + 0x9E3779B9 & MASK, k1 + 0xBB67AE85 & MASK
    return c0 << 32 | c1, c2 << 32 | c3


PLACES = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (9999, 123_456, 23), (MASK, MASK, MASK)]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("seed", [0, 12345, 2**200])
def test_uniforms_are_53_bits_of_philox(seed: int, place: tuple[int, int, int]) -> None:
    episode, decision, index = place
    bits, _ = words(seed, 1, (episode, decision, index, MASK))
    drawn = Stream(seed, "actions").uniforms([episode], [decision], index)
    assert drawn.tolist() == [(bits >> 11) / 2**53]


@pytest.mark.parametrize(
    ("shots", "p"), [(1, 0.3), (16, 0.4), (64, 0.5), (1024, 0.003), (1024, 0.6), (100_000, 0.1)]
)
def test_counts_are_quantiles_of_52_bits_of_philox(shots: int, p: float) -> None:
    for episode, decision, _ in PLACES:
        pairs = [words(5, 0, (episode, decision, pair, 0)) for pair in range(3)]
        uniform = [(2 * (bits >> 12) + 1) / 2**53 for pair in pairs for bits in pair][:5]
        drawn = Stream(5, "shots").binomial(shots, np.full((1, 5), p), [episode], [decision])
        assert drawn.tolist() == [stats.binom.ppf(uniform, shots, p).tolist()]


def draw(shots: int, p: np.ndarray, episode: np.ndarray, decision: np.ndarray) -> np.ndarray:
    return Stream(3, "shots").binomial(shots, p, episode, decision)


@pytest.mark.parametrize("shots", [32, 1024, 8192, 100_000])
def test_counts_repeat_in_any_batch_and_order(shots: int) -> None:
    p = RNG.uniform(-1e-3, 1 + 1e-3, (10_000, 25))
    episode, decision = RNG.integers(0, 5000, 10_000), RNG.integers(0, 500, 10_000)
    counts = draw(shots, p, episode, decision)
    order = RNG.permutation(10_000)
    np.testing.assert_array_equal(
        draw(shots, p[order], episode[order], decision[order]), counts[order]
    )
    for start, stop in ((0, 1), (1, 3), (9990, 10_000), (17, 120), (300, 1300)):
        rows = slice(start, stop)
        np.testing.assert_array_equal(
            draw(shots, p[rows], episode[rows], decision[rows]), counts[rows]
        )


@pytest.mark.parametrize("shots", [16, 1024, 8192])
def test_a_count_repeats_alone(shots: int) -> None:
    p = RNG.uniform(0, 1, (12, 25))
    episode, decision = np.arange(12), np.arange(100, 112)
    counts = draw(shots, p, episode, decision)
    stream = Stream(3, "shots")
    for row in range(12):
        for circuits in range(1, 26):
            some = p[row : row + 1, :circuits]
            alone = stream.binomial(shots, some, [row], [100 + row])
            assert alone.tolist() == [counts[row, :circuits].tolist()]


def test_uniforms_repeat_in_any_batch_and_order() -> None:
    stream = Stream(0, "actions")
    episode, decision = RNG.integers(0, 10_000, 3000), RNG.integers(0, 1000, 3000)
    drawn, order = stream.uniforms(episode, decision), RNG.permutation(3000)
    np.testing.assert_array_equal(stream.uniforms(episode[order], decision[order]), drawn[order])
    assert stream.uniforms(episode[5], decision[5]) == drawn[5]
    table = stream.uniforms(episode[:, None], decision[:, None], np.arange(3))
    np.testing.assert_array_equal(table[:, 0], drawn)


def test_uniforms_are_uniform_in_all_their_bits() -> None:
    """Chi-square of the highest and the lowest ten bits and of pairs, at one in a million each."""
    drawn = Stream(0, "actions").uniforms(np.arange(1000)[:, None], np.arange(1000))
    assert drawn.min() >= 0.0
    assert drawn.max() < 1.0
    high = (drawn * 1024).astype(int)
    low = (drawn * 2**53).astype(np.uint64) % np.uint64(1024)
    pairs = (drawn[:, ::2] * 32).astype(int) * 32 + (drawn[:, 1::2] * 32).astype(int)
    for cells in (high, low, pairs):
        assert stats.chisquare(np.bincount(cells.ravel().astype(int))).pvalue > 1e-6


SHAPE = (300, 40, 25)
"""Episodes, decisions, circuits."""


def scores(shots: int, seed: int, purpose: Purpose = "shots") -> np.ndarray:
    """Counts of a fair coin in units of their standard deviation, of SHAPE."""
    episode, decision = (index.ravel() for index in np.indices(SHAPE[:2]))
    counts = Stream(seed, purpose).binomial(shots, np.full((12_000, 25), 0.5), episode, decision)
    return ((counts - shots / 2) / np.sqrt(shots / 4)).reshape(SHAPE)


@pytest.mark.parametrize("shots", [1, 16, 1024])
def test_neighbours_are_uncorrelated(shots: int) -> None:
    """The mean product of N independent scores has standard error 1 / sqrt(N); five of them."""
    here = scores(shots, seed=0)
    square, above = here[:40], np.triu_indices(40, 1)
    pairs = {
        "circuits": (here[:, :, 1:], here[:, :, :-1]),
        "decisions": (here[:, 1:], here[:, :-1]),
        "episodes": (here[1:], here[:-1]),
        "episode and decision": (square[above], square.swapaxes(0, 1)[above]),
        **{f"seed {seed}": (here, scores(shots, seed)) for seed in (1, 2, 2**32)},
        "purposes": (here, scores(shots, 0, "actions")),
    }
    for name, (first, second) in pairs.items():
        assert abs((first * second).mean()) < 5 / np.sqrt(first.size), name


def test_streams_are_known_by_seed_and_purpose() -> None:
    assert Stream(1, "shots") == Stream(1, "shots") != Stream(1, "actions")
    assert repr(Stream(1, "shots")) == "Stream(seed=1, purpose='shots')"
