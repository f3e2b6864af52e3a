"""The results of trainings with several seeds: all of them, and the best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qcompile.arrays import FloatArray
from qcompile.errors import QcompileError
from qcompile.notebook import reward_text
from qcompile.report.curves import CurvePanel, draw_curves
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.table import Cell, Column, Table
from qcompile.report.tables import plural, reward_cell, score_cell
from qcompile.verbs.results import Result
from qcompile.verbs.training import Training

if TYPE_CHECKING:
    from qcompile.policy import AnyPolicy

_SHARED = (
    *("environment", "environment_kwargs", "model", "preset"),
    *("backend", "shots", "mitigation", "parameters"),
)


@dataclass(frozen=True, eq=False)
class Scored:
    """A training, the rewards by which the best is chosen, and the rewards of other episodes."""

    training: Training
    rewards: FloatArray
    others: FloatArray

    @property
    def seed(self) -> int:
        return int(self.training.to_dict()["seed"])


class Trainings(Training):
    """Trainings that differ in their seed; `to_dict` is the document of `qcompile train --seeds`.

    Policy, episodes and rewards are those of the best, by the mean reward of the episodes that its
    trained model played. The best of several means is too high an estimate: `best` in the document
    has the mean reward of other episodes. `trainings` are all finished trainings, by seed.
    """

    def __init__(
        self,
        scored: Sequence[Scored],
        *,
        policy: AnyPolicy,
        requested: int,
        failures: Mapping[int, str],
        out: Path | None,
        interrupted: bool,
        failure: QcompileError | None,
    ):
        best = best_of(scored)
        means = np.array([one.rewards.mean() for one in scored])
        document = best.training.to_dict()
        Result.__init__(
            self,
            {name: document[name] for name in _SHARED if name in document}
            | {
                "seeds": [one.seed for one in scored],
                "evaluation": len(best.rewards),
                "trainings": [one.training.to_dict() | _moments(one.rewards) for one in scored],
                "mean_reward": float(means.mean()),
                "std_reward": float(means.std()) if len(means) > 1 else None,
                "best": {"seed": best.seed} | _moments(best.others),
                "failures": [{"seed": seed, "words": text} for seed, text in failures.items()],
                "out": None if out is None else str(out),
                "interrupted": interrupted,
            },
        )
        self.policy, self.failure, self.interrupted = policy, failure, interrupted
        self.stopped, self.trainings = False, [one.training for one in scored]
        self.model = best.training.model
        self._copy_episodes(best.training)
        self._requested = requested

    def plot(self, style: AnyStyle = None) -> Figure:
        """The learning curves of all: average rewards of the last 20 episodes.

        Raises:
            FigureError: the style cannot be read.
            QcompileError: a training finished no episode.
        """
        labels = [f"seed {one.to_dict()['seed']}" for one in self.trainings]
        curves = [one.curve(label) for one, label in zip(self.trainings, labels, strict=True)]
        values = self.to_dict()
        title = f"{values['environment']}, {values['model']}"
        lines = [replace(curve, low=curve.mean, high=curve.mean) for curve in curves]
        return draw_curves([CurvePanel(title, lines)], style)

    def table(self) -> Table:
        """A row for each seed."""
        rows = [
            [
                *(Cell.of(one[name]) for name in ("seed", "episodes", "steps")),
                reward_cell(one["last_20_mean_reward"]),
                score_cell(one["mean_reward"], one["std_reward"]),
            ]
            for one in self.to_dict()["trainings"]
        ]
        columns = map(Column, ("seed", "episodes", "steps", "last 20"))
        fresh = f"{self.to_dict()['evaluation']} fresh episodes"
        scores = Column(fresh, parts=(f"{fresh}, mean", f"{fresh}, standard deviation"))
        missing = [] if len(rows) == self._requested else [self._finished]
        return Table([*columns, scores], rows, notes=missing)

    @property
    def _finished(self) -> str:
        return f"{len(self.trainings)} of {self._requested} trainings finished."

    @property
    def remark(self) -> str:
        """The mean over the seeds, and the best's score on episodes that did not choose it."""
        values = self.to_dict()
        best, count = values["best"], len(values["seeds"])
        score = f"{_words(best)} on {plural(values['evaluation'], 'other episode')}"
        if count == 1:
            return f"seed {best['seed']} scores {score}"
        return (
            f"mean of {count} seeds: {_words(values)}; the best, seed {best['seed']}, "
            f"scores {score}"
        )

    @property
    def words(self) -> str:
        """The remark, and where the policy was written."""
        values = self.to_dict()
        written = "" if values["out"] is None else f" in {values['out']}"
        return f"{self.remark}; {values['parameters']} parameters{written}"

    def check_complete(self) -> None:
        """Check that all trainings were finished.

        Raises:
            QcompileError: some failed, or Ctrl-C came before; the message says what is kept.
        """
        values = self.to_dict()
        out, finished = values["out"], self._finished
        hints = [f"Seed {one['seed']}: {one['words']}" for one in values["failures"]]
        has_failed = bool(hints)
        if out is not None:
            hints.append(f"The best policy of these is in {out}.")
        if self.failure is not None:
            raise self.failure.with_hints(finished, *hints)
        if self.interrupted:
            raise QcompileError(f"Interrupted: {finished}", *hints)
        if has_failed:
            raise QcompileError(finished, *hints)


def best_of(scored: Sequence[Scored]) -> Scored:
    """The training with the highest mean reward; among equals the one with the lowest seed."""
    return max(scored, key=lambda one: (one.rewards.mean(), -one.seed))


def _moments(rewards: FloatArray) -> dict[str, float]:
    return {"mean_reward": float(rewards.mean()), "std_reward": float(rewards.std())}


def _words(moments: Mapping[str, Any]) -> str:
    """Mean ± standard deviation; a single value has no deviation."""
    return reward_text(moments["mean_reward"], moments["std_reward"])
