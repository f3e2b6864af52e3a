"""The summary of a row over its seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qcompile.notebook import reward_text
from qcompile.rl.order import AVERAGED
from qcompile.sweep.pages import csv_text
from qcompile.sweep.study.cell import CellResult, first_at
from qcompile.sweep.study.rows import Row

TOO_FEW = f"under {AVERAGED} episodes"
_CURVE_POINTS = 200


@dataclass(frozen=True, eq=False)
class RowSummary:
    """A row with the results of its seeds, in the order of the seeds.

    An average is over the last 20 episodes, in the order in which they began. `mean_curve` is the
    mean of the seeds' averages after each episode, up to the end of the shortest training.
    """

    row: Row
    results: tuple[CellResult, ...]

    @property
    def parameters(self) -> int:
        return self.results[0].parameters

    @property
    def averages(self) -> NDArray[np.float64]:
        """(seeds, episodes), cut at the shortest training."""
        curves = [result.averages for result in self.results]
        length = min(map(len, curves))
        return np.stack([curve[:length] for curve in curves])

    @property
    def mean_curve(self) -> NDArray[np.float64]:
        return np.asarray(self.averages.mean(axis=0))

    @property
    def mean_first(self) -> int | None:
        """The first episode after which the mean over the seeds is at the target, if ever."""
        target = self.row.target
        return None if target is None else first_at(self.mean_curve, target)

    @property
    def each_first(self) -> list[int | None]:
        """The first episode at the target for each seed."""
        target = self.row.target
        return [None if target is None else result.first_at(target) for result in self.results]

    @property
    def seeds(self) -> list[int]:
        """The seeds that were trained."""
        return [result.seed for result in self.results]

    @property
    def median_first(self) -> float | None:
        """The median of `each_first`; None if half the seeds or more do not reach the target."""
        median = float(np.median([np.inf if f is None else f for f in self.each_first]))
        return median if np.isfinite(median) else None

    def values(self) -> dict[str, Any]:
        """The figures as plain values."""
        return {
            "row": self.row.name,
            "environment": self.row.environment,
            "preset": self.row.preset,
            "seeds": self.seeds,
            "parameters": self.parameters,
            "target": self.row.target,
            "mean_at_target": self.mean_first,
            "each_at_target": self.each_first,
            "best_average": [result.best_average for result in self.results],
            "last_average": [result.last_average for result in self.results],
            "evaluation_mean": self.evaluation.tolist(),
        }

    @property
    def best(self) -> NDArray[np.float64]:
        """The best average of each seed, (seeds,); nan if it has fewer than 20 episodes."""
        return np.array([result.best_average for result in self.results], dtype=np.float64)

    @property
    def final(self) -> NDArray[np.float64]:
        """The last average of each seed, (seeds,); nan if it has fewer than 20 episodes."""
        return np.array([result.last_average for result in self.results], dtype=np.float64)

    @property
    def evaluation(self) -> NDArray[np.float64]:
        """The mean reward of each seed's trained model in new episodes, (seeds,)."""
        return np.array([np.mean(result.evaluation) for result in self.results])


def moments(values: NDArray[np.float64]) -> tuple[float | None, float | None]:
    """Mean and standard deviation over the seeds: None where `spread` has none."""
    if np.isnan(values).any():
        return None, None
    return float(values.mean()), float(values.std()) if len(values) > 1 else None


def spread(values: NDArray[np.float64]) -> str:
    """Mean ± standard deviation over the seeds as text; values (seeds,), nan if a seed has none.

    A single seed has no deviation.
    """
    if np.isnan(values).any():
        return TOO_FEW
    if len(values) == 1:
        return f"{reward_text(values[0])}, one seed"
    return reward_text(values.mean(), values.std())


def results_csv(summaries: Sequence[RowSummary]) -> str:
    """A line for each training: row, seed, and the numbers of the tables."""
    lines = [
        [
            summary.row.name,
            summary.row.title,
            summary.row.environment,
            summary.row.preset,
            result.seed,
            result.parameters,
            len(result.rewards),
            result.steps[-1] if result.steps else 0,
            summary.row.target,
            "" if first is None else first,
            "" if result.best_average is None else f"{result.best_average:.2f}",
            "" if result.last_average is None else f"{result.last_average:.2f}",
            f"{np.mean(result.evaluation):.2f}",
            f"{np.std(result.evaluation):.2f}",
        ]
        for summary in summaries
        for result, first in zip(summary.results, summary.each_first, strict=True)
    ]
    header = (
        "row,title,environment,preset,seed,parameters,episodes,steps,target,episodes_to_target,"
        "best_average,last_average,evaluation_mean,evaluation_std"
    )
    return csv_text(header.split(","), lines)


def curves_csv(summaries: Sequence[RowSummary]) -> str:
    """The curves of the figures: mean, std and range over the seeds after each episode."""
    lines = []
    for summary in summaries:
        averages = summary.averages
        for episode in curve_episodes(averages.shape[1]):
            column = averages[:, episode - 1]
            figures = (column.mean(), column.std(), column.min(), column.max())
            lines.append([summary.row.name, int(episode), *(f"{v:.2f}" for v in figures)])
    return csv_text(["row", "episode", "mean", "std", "lowest", "highest"], lines)


def curve_episodes(count: int) -> NDArray[np.intp]:
    """The episodes out of `count` that a curve is drawn through, evenly spread."""
    return np.unique(np.linspace(1, count, min(count, _CURVE_POINTS)).round().astype(np.intp))
