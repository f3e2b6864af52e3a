"""Distributions of rewards, as they are drawn."""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.patches import StepPatch

from qcompile.report.distribution import Sample, draw_distributions
from qcompile.report.figure import Figure
from qcompile.report.rewards import draw_rewards


def steps(figure: Figure) -> list[StepPatch]:
    (axes,) = figure._drawing.axes
    return [patch for patch in axes.patches if isinstance(patch, StepPatch)]


def test_a_histogram_counts_every_episode() -> None:
    """Rewards 0 (three times), 4 and 8 in eight bins of width 1: heights 3, 1 and 1."""
    figure = draw_distributions("", [Sample("a", [0.0, 0.0, 0.0, 4.0, 8.0])])
    (patch,) = steps(figure)
    heights, edges, base = patch.get_data()
    np.testing.assert_allclose(edges, np.arange(9.0))
    np.testing.assert_allclose((heights - base) / 0.52 * 3, [3, 0, 0, 0, 1, 0, 0, 1][:8])


def test_samples_share_their_bins_and_stand_below_each_other() -> None:
    samples = [Sample("above", [0.0, 1.0]), Sample("below", [10.0, 20.0], [12.0, 18.0], grey=True)]
    figure = draw_distributions("", samples)
    above, below = (patch.get_data() for patch in steps(figure))
    np.testing.assert_array_equal(above.edges, below.edges)
    assert (above.edges[0], above.edges[-1]) == (0.0, 20.0)
    assert above.baseline > np.max(below.values)
    assert re.findall(r">(above|below)<", figure.svg()) == ["above", "below"]


@pytest.mark.parametrize(("rewards", "seen"), [([5.0] * 6, False), ([4.0, 5.0] * 3, True)])
def test_the_legend_has_an_interval_that_is_seen(rewards: list[float], seen: bool) -> None:
    interval = [min(rewards), max(rewards)]
    summary = {
        "policy": "p",
        "backend": "b",
        "episodes": [{"reward": reward} for reward in rewards],
        "mean_reward": 5.0,
        "ci95": interval,
    }
    for figure in (draw_distributions("", [Sample("a", rewards, interval)]), draw_rewards(summary)):
        (legend,) = figure._drawing.legends
        words = [text.get_text() for text in legend.get_texts()]
        assert any("95 %" in text for text in words) == seen
        assert "mean" in words


@pytest.mark.parametrize("rewards", [[5.0], [5.0] * 40])
def test_equal_rewards_have_a_bin_around_them(rewards: list[float]) -> None:
    (patch,) = steps(draw_distributions("", [Sample("a", rewards)]))
    data = patch.get_data()
    tallest = int(np.argmax(data.values))
    assert data.edges[tallest] < 5.0 < data.edges[tallest + 1]
