"""The result of a training."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from qcompile.notebook import count
from qcompile.policy import AnyPolicy
from qcompile.rl.rollout import FinishedEpisode


@dataclass(frozen=True, eq=False, repr=False)
class TrainingResult:
    """The trained model, its policy and every finished episode.

    `interrupted` says whether Ctrl-C ended the training.
    """

    actor: torch.nn.Module
    policy: AnyPolicy
    episodes: list[FinishedEpisode]
    steps: int
    interrupted: bool

    def __repr__(self) -> str:
        episodes, steps = count(len(self.episodes), "episode"), count(self.steps, "step")
        ended = ", interrupted" * self.interrupted
        return f"TrainingResult({self.policy}, {episodes}, {steps}{ended})"
