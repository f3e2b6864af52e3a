"""Follow a training: log its episodes, evaluate it, and keep its checkpoint."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from qcompile.rl.checkpoint import save_checkpoint
from qcompile.rl.ppo import Trainer
from qcompile.rl.result import TrainingResult
from qcompile.rl.rollout import FinishedEpisode
from qcompile.rl.score import score
from qcompile.rl.training_log import Averages, EpisodeLog, Scalars, Update

CHECKPOINT_SECONDS = 10.0
EVALUATION_SEED = 1_000_000
"""Every evaluation resets its episodes with the seeds from here on."""


@dataclass(frozen=True)
class Evaluation:
    """What the model scored by then; `std_reward` is that of the episodes, not of the mean."""

    episode: int
    steps: int
    mean_reward: float
    std_reward: float


class Watch:
    """The listeners of one training, and what they found.

    `every` is the number of training episodes between evaluations, None for none; an evaluation
    plays `episodes`. `checkpoint` is written at most every 10 seconds, and at the end. `log` and
    `scalars` can be set before `train`.
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
        self.scalars: Scalars | None = None
        self.averages = Averages(trainer.settings.environments, trainer.history)
        self.evaluations: list[Evaluation] = []
        self._seen = len(trainer.history)
        self._due = 0 if every is None else (self._seen // every + 1) * every
        self._update: Update | None = None
        self._saves = checkpoint is not None or trainer.policy() is None
        self._state: dict[str, Any] | None = trainer.state() if self._saves else None
        self._written = time.monotonic()
        self.has_learned = trainer.steps > 0
        """Whether there was a whole rollout, now or before a checkpoint."""

    def train(self) -> TrainingResult:
        """Train to the end, or to Ctrl-C; then the log and the checkpoint are complete.

        Raises:
            EnvironmentStepError, TrainingError: what ends a training early; they are complete too.
        """
        try:
            return self._trainer.train(self._on_episode, self._on_update)
        finally:
            for episode in self._trainer.history[self._seen :]:  # of a rollout that was cut short
                self._note(episode)
            if self._checkpoint is not None:
                self.save(self._checkpoint)

    def save(self, path: Path) -> None:
        """Write a checkpoint of the training as it was after its last whole update."""
        save_checkpoint(self._trainer, path, self._state)
        self._written = time.monotonic()

    def _on_episode(self, episode: FinishedEpisode, progress: float) -> None:
        self._note(episode)
        words = [f"episode {episode.episode}"]
        if self.averages.last is not None:
            words.append(f"last 20: {self.averages.last:.1f}")
        if self.averages.best is not None:
            words.append(f"best {self.averages.best:.1f}")
        if self.evaluations:
            words.append(f"test {self.evaluations[-1].mean_reward:.1f}")
        self._show(progress, ", ".join(words))

    def _note(self, episode: FinishedEpisode) -> None:
        self._seen = episode.episode
        self.averages.add(episode)
        if self.log is not None:
            self.log.add_missing([episode])
        if self.scalars is not None:
            self.scalars.episode(episode, self.averages.last)

    def _on_update(self) -> None:
        update = self._trainer.last_update
        if self.scalars is not None and update is not None and update is not self._update:
            self.scalars.update(update)
        self._update, self.has_learned = update, True
        self._evaluate()  # before the state is kept: resuming repeats what Ctrl-C breaks off
        if self._saves:
            self._state = self._trainer.state()
        late = time.monotonic() - self._written >= CHECKPOINT_SECONDS
        if self._checkpoint is not None and late:
            self.save(self._checkpoint)

    def _evaluate(self) -> None:
        episode, steps = len(self._trainer.history), self._trainer.steps
        if self._every is None or episode < self._due:
            return
        rewards = score(self._trainer, self._episodes, EVALUATION_SEED)
        self._due = (episode // self._every + 1) * self._every
        mean = float(rewards.mean())
        self.evaluations.append(Evaluation(episode, steps, mean, float(rewards.std())))
        if self.scalars is not None:
            self.scalars.evaluation(mean, steps)
