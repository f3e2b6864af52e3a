"""Train one cell, and the schema of its file."""

from __future__ import annotations

import time
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from qcompile.errors import TrainingError
from qcompile.rl.order import AVERAGED, in_order_of_start
from qcompile.rl.settings import PACKAGES, plain, restored
from qcompile.sweep.folder import Folder
from qcompile.sweep.study.rows import Cell
from qcompile.version import versions

EVALUATION_EPISODES = 100
EVALUATION_SEED = 10_000
"""First reset seed of the episodes that the trained model plays; trainings do not use these."""

Steps = Annotated[int, Field(ge=1)]


def first_at(averages: NDArray[np.float64], target: float) -> int | None:
    """The first episode, from the 20th, after which the average is at the target; None if never."""
    reached = np.flatnonzero(averages[AVERAGED - 1 :] >= target)
    return int(reached[0]) + AVERAGED if len(reached) else None


class CellResult(BaseModel):
    """The result of a training; `steps` and `rewards` have an entry for each episode.

    So does `decisions`, if decisions differ from steps.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    format: Literal["qcompile-study-1"] = "qcompile-study-1"
    row: str
    seed: int
    environment: str
    environment_kwargs: dict[str, Any] = {}
    settings: dict[str, Any]
    versions: dict[str, str]
    parameters: int
    steps: list[Steps]
    decisions: list[Steps] | None = None
    rewards: Annotated[list[float], Field(min_length=1)]
    evaluation: list[float]
    wall_seconds: float

    @model_validator(mode="after")
    def _same_length(self) -> CellResult:
        for name in ("steps", "decisions"):
            entries = getattr(self, name)
            if entries is not None and len(entries) != len(self.rewards):
                raise ValueError(f"{len(entries)} {name} for {len(self.rewards)} rewards")
        return self

    @cached_property
    def averages(self) -> NDArray[np.float64]:
        """The average of the last 20 rewards (fewer before the 20th), after each episode.

        Episodes are in the order in which they began. Episodes that began after the first one that
        the end of the training cut off are left out.
        """
        finished = zip(self.decisions or self.steps, self.rewards, strict=True)
        rewards = [*in_order_of_start(finished, self.settings.get("environments", 1))]
        total = np.cumsum([0.0, *rewards])
        end = np.arange(1, len(rewards) + 1)
        start = np.maximum(end - AVERAGED, 0)
        return np.asarray((total[end] - total[start]) / (end - start))

    @property
    def full_averages(self) -> NDArray[np.float64]:
        """The averages over 20 episodes; empty if there are fewer episodes."""
        return self.averages[AVERAGED - 1 :]

    @property
    def best_average(self) -> float | None:
        """The best average over 20 episodes; None if there are fewer."""
        return float(self.full_averages.max()) if len(self.full_averages) else None

    @property
    def last_average(self) -> float | None:
        """The last average over 20 episodes; None if there are fewer."""
        return float(self.full_averages[-1]) if len(self.full_averages) else None

    def first_at(self, target: float) -> int | None:
        """The first episode, from the 20th, after which the average is at the target."""
        return first_at(self.averages, target)


def run_cell(cell: Cell, evaluation: int = EVALUATION_EPISODES) -> CellResult:
    """Train the cell and play `evaluation` episodes with the trained model, on one thread.

    Raises:
        KeyboardInterrupt: Ctrl-C; an unfinished training is not a result.
        TrainingError: no episode ended.
    """
    import torch

    from qcompile.rl.ppo import Trainer
    from qcompile.rl.score import score

    torch.set_num_threads(1)
    started = time.perf_counter()
    row = cell.row
    trainer = Trainer(row.environment, row.settings, cell.seed, arguments=row.arguments)
    result = trainer.train()
    if result.interrupted:
        raise KeyboardInterrupt
    if not result.episodes:
        steps = f"its {trainer.steps:,} steps"
        raise TrainingError(f"No episode ended within {steps}.", "Give the row more steps.")
    rewards = score(trainer, evaluation, EVALUATION_SEED)
    return CellResult(
        row=row.name,
        seed=cell.seed,
        environment=row.environment,
        environment_kwargs=dict(row.arguments),
        settings=plain(row.settings),
        versions=versions(*PACKAGES),
        parameters=result.policy.parameter_count,
        steps=[episode.steps for episode in result.episodes],
        decisions=None
        if row.settings.hold == 1
        else [episode.decisions for episode in result.episodes],
        rewards=[round(episode.reward, 2) for episode in result.episodes],
        evaluation=[round(float(reward), 2) for reward in rewards],
        wall_seconds=round(time.perf_counter() - started, 1),
    )


def folder_of(path: Path, evaluation: int | None = None) -> Folder[Cell, CellResult]:
    """The trainings of a study in `path`; `evaluation` is the number of episodes that they need."""
    return Folder(path, CellResult, partial(_match, evaluation=evaluation))


def _match(cell: Cell, result: CellResult, evaluation: int | None) -> CellResult | None:
    """The result, if its settings, environment, arguments and seed are those of the cell."""
    try:
        settings = restored(result.settings)
    except TrainingError:
        return None
    row = cell.row
    expected = (row.environment, row.arguments, row.settings, cell.seed)
    if (result.environment, result.environment_kwargs, settings, result.seed) != expected:
        return None
    return result if evaluation in (None, len(result.evaluation)) else None
