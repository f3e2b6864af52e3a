"""Follows a training: reports its progress, evaluates it, and writes its checkpoint."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from qcompile.notebook import reward_text
from qcompile.rl.checkpoint import save_checkpoint
from qcompile.rl.ppo import Trainer
from qcompile.rl.result import TrainingResult
from qcompile.rl.rollout import FinishedEpisode
from qcompile.rl.score import score
from qcompile.rl.training_log import Averages, Callback, EpisodeLog, Update

CHECKPOINT_SECONDS = 10.0
EVALUATION_SEED = 1_000_000
"""The first seed of the episodes of every evaluation."""


@dataclass(frozen=True)
class Evaluation:
    """A score of the model during training; `std_reward` is over episodes, not of the mean."""

    episode: int
    steps: int
    mean_reward: float
    std_reward: float


class Watch:
    """Follows one training and collects its evaluations.

    `every` is the number of training episodes between evaluations, None for no evaluations; an
    evaluation plays `episodes` episodes. `checkpoint` is written at most every 10 seconds, and at
    the end. `log` and `callbacks` can be set before `train`. `callback_error` is an exception of a
    callback that ended the training; `stopped` says whether a callback ended it by returning False.
    """

    def __init__(
        self,
        trainer: Trainer,
        show: Callable[[float, str], None],
        checkpoint: Path | None = None,
        every: int | None = None,
        episodes: int = 20,
    ):
        self._trainer, self._show, self._checkpoint = trainer, show, checkpoint
        self._every, self._episodes = every, episodes
        self.log: EpisodeLog | None = None
        self.callbacks: list[Callback] = []
        self.callback_error: Exception | None = None
        self.stopped = False
        self.averages = Averages(trainer.settings.environments, trainer.history)
        self.evaluations: list[Evaluation] = []
        self._recorded = len(trainer.history)
        self._due = 0 if every is None else (self._recorded // every + 1) * every
        self._update: Update | None = None
        self._saves = checkpoint is not None
        self._state: dict[str, Any] | None = trainer.state() if self._saves else None
        self._written = time.monotonic()
        self.has_learned = trainer.steps > 0
        """Whether there was a complete rollout, now or before a checkpoint."""

    def train(self) -> TrainingResult:
        """Train until the end, Ctrl-C or a callback's False; then log and checkpoint are complete.

        Raises:
            EnvironmentStepError, TrainingError: the training failed; both are complete.
            Exception: a callback raised it; both are complete.
        """
        try:
            return self._trainer.train(self._on_episode, self._on_update)
        finally:
            try:  # episodes of an interrupted rollout
                for episode in self._trainer.history[self._recorded :]:
                    self._record(episode)
            finally:
                if self._checkpoint is not None:
                    self.save(self._checkpoint)

    def save(self, path: Path) -> None:
        """Write a checkpoint of the training as of its last complete update."""
        save_checkpoint(self._trainer, path, self._state)
        self._written = time.monotonic()

    def _on_episode(self, episode: FinishedEpisode, progress: float) -> None:
        self._record(episode)
        words = [f"episode {episode.episode}"]
        if self.averages.last is not None:
            words.append(f"last 20: {reward_text(self.averages.last)}")
        if self.averages.best is not None:
            words.append(f"best {reward_text(self.averages.best)}")
        if self.evaluations:
            words.append(f"test {reward_text(self.evaluations[-1].mean_reward)}")
        self._show(progress, ", ".join(words))

    def _record(self, episode: FinishedEpisode) -> None:
        self._recorded = episode.episode
        self.averages.add(episode)
        if self.log is not None:
            self.log.add_missing([episode])
        scalars = {"rollout/episode_reward": episode.reward}
        if self.averages.last is not None:
            scalars["rollout/average_20"] = self.averages.last
        self._report(scalars, episode.steps)

    def _report(self, scalars: Mapping[str, float], steps: int) -> None:
        """Call every callback, unless one has raised an exception."""
        for callback in self.callbacks if self.callback_error is None else ():
            try:
                outcome = callback(scalars, steps)
            except Exception as error:
                self.callback_error = error
                raise
            if isinstance(outcome, bool | np.bool_) and not outcome:
                self.stopped = True

    def _on_update(self) -> bool:
        """Whether to continue the training."""
        update, self.has_learned = self._trainer.last_update, True
        if update is not None and update is not self._update:
            self._report(update.scalars, update.steps)
        self._update = update
        self._evaluate()  # before storing the state: resuming then repeats it
        if self._saves:
            self._state = self._trainer.state()
        late = time.monotonic() - self._written >= CHECKPOINT_SECONDS
        if self._checkpoint is not None and late:
            self.save(self._checkpoint)
        return not self.stopped

    def _evaluate(self) -> None:
        episode, steps = len(self._trainer.history), self._trainer.steps
        if self._every is None or episode < self._due:
            return
        rewards = score(self._trainer, self._episodes, EVALUATION_SEED)
        self._due = (episode // self._every + 1) * self._every
        mean = float(rewards.mean())
        self.evaluations.append(Evaluation(episode, steps, mean, float(rewards.std())))
        self._report({"evaluation/mean_reward": mean}, steps)
