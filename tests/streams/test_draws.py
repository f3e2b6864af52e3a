"""Draws made ahead are those of the streams, in any order of calls."""

from __future__ import annotations

import numpy as np
import pytest

from qcompile.streams import Draws, Stream

RNG = np.random.default_rng(3)
CIRCUITS = 5


def expected(shots: int, p: np.ndarray, episode: np.ndarray, decision: np.ndarray) -> np.ndarray:
    """The counts of each row by itself, from the stream of seed 4."""
    stream = Stream(4, "shots")
    rows = zip(p.reshape(-1, CIRCUITS), episode.flat, decision.flat, strict=True)
    counts = [stream.binomial(shots, row[None], [e], [d]) for row, e, d in rows]
    return np.concatenate(counts).reshape(p.shape)


def check(draws: Draws, shots: int, episode: np.ndarray, decision: np.ndarray) -> None:
    rows, copies = episode.shape
    p = RNG.uniform(0, 1, (rows, copies * CIRCUITS))
    counts = draws.rows(episode, decision).binomial(shots, p)
    np.testing.assert_array_equal(counts, expected(shots, p, episode, decision))
    places = episode.ravel(), decision.ravel()
    np.testing.assert_array_equal(
        draws.actions(*places), Stream(4, "actions").uniforms(*places), strict=True
    )


@pytest.mark.parametrize("shots", [16, 1024])
def test_episodes_drop_out_of_lockstep(shots: int) -> None:
    draws, living = Draws(4, CIRCUITS), np.arange(100, 108)
    for decision in range(70):
        if decision in (3, 20, 21, 40, 65):
            living = np.delete(living, RNG.integers(len(living)))
        check(draws, shots, living[:, None], np.full((len(living), 1), decision))


def test_copies_share_a_row() -> None:
    draws = Draws(4, CIRCUITS)
    episode = np.array([[0, 1, 2], [5, 6, 6]])  # the last place is filled up
    for decision in range(10):
        check(draws, 1024, episode, np.full((2, 3), decision))


def test_circuits_with_shots_of_their_own() -> None:
    """Each count is that of all circuits with its shots."""
    draws, shots, stream = Draws(4, 6), np.array([9, 9, 8, 8, 8, 8]), Stream(4, "shots")
    for decision in (0, 1, 2, 7):
        episode, place = np.arange(5), np.full(5, decision)
        p = RNG.uniform(0, 1, (5, 6))
        more, fewer = (stream.binomial(n, p, episode, place) for n in (9, 8))
        counts = draws.rows(episode[:, None], place[:, None]).binomial(shots, p)
        np.testing.assert_array_equal(counts, np.hstack([more[:, :2], fewer[:, 2:]]))
        equal = draws.rows(episode[:, None], place[:, None]).binomial(8, p)
        np.testing.assert_array_equal(equal, fewer)


def test_decisions_in_any_order_and_mixture() -> None:
    draws, episode = Draws(4, CIRCUITS), np.arange(6).reshape(6, 1)
    for decision in range(5):
        check(draws, 64, episode, np.full((6, 1), decision))
    for _ in range(20):
        check(draws, 64, episode, RNG.integers(0, 6, (6, 1)))
        check(draws, 64, RNG.permutation(episode), np.full((6, 1), RNG.integers(0, 6)))
        check(draws, 64, RNG.integers(0, 9, (4, 1)), np.full((4, 1), RNG.integers(0, 6)))
    for shots in (64, 128, 64):
        check(draws, shots, episode, np.full((6, 1), 3))
    nothing = draws.binomial(64, np.zeros((0, CIRCUITS)), episode[:0], episode[:0])
    assert nothing.shape == (0, CIRCUITS)


def test_lockstep_draws_blocks_of_bounded_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few calls for 400 decisions while episodes end; two million numbers a block at most."""
    sizes = []
    scores = Stream.scores

    def spy(self: Stream, *arguments: object) -> np.ndarray:
        sizes.append(0)
        drawn = scores(self, *arguments)  # type: ignore[arg-type]
        sizes[-1] = drawn.size
        return drawn

    monkeypatch.setattr(Stream, "scores", spy)
    for episodes, decisions, most in ((4, 400, 20), (1000, 40, 8)):
        draws, episode = Draws(4, 24), np.arange(episodes)[:, None]
        sizes.clear()
        for decision in range(decisions):
            if decision in (100, 200):
                episode = episode[1:]
            p, where = np.full((len(episode), 24), 0.5), np.full_like(episode, decision)
            draws.binomial(64, p, episode, where)
        assert len(sizes) <= most
        assert max(sizes) <= 2_000_000


def test_drawing_does_not_change_earlier_draws() -> None:
    draws, episode = Draws(4, CIRCUITS), np.arange(3)[:, None]
    p = RNG.uniform(0, 1, (3, CIRCUITS))
    first = [draws.binomial(100, p, episode, np.full((3, 1), decision)) for decision in range(8)]
    again = [draws.binomial(100, p, episode, np.full((3, 1), decision)) for decision in range(8)]
    np.testing.assert_array_equal(first, again)


def test_rows_need_a_place_for_each_copy() -> None:
    place = np.zeros((2, 1), dtype=np.int64)
    with pytest.raises(ValueError, match="reshape"):
        Draws(4, CIRCUITS).binomial(16, np.zeros((2, 2 * CIRCUITS)), place, place)
