"""The result of a training: the policy, its episodes, and how it ended."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from qcompile.errors import QcompileError
from qcompile.notebook import reward_text
from qcompile.report.curves import Curve, CurvePanel, draw_curves
from qcompile.report.figure import Figure
from qcompile.report.style import AnyStyle
from qcompile.report.table import Cell, Column, Table
from qcompile.report.tables import reward_cell
from qcompile.verbs.results import Result

if TYPE_CHECKING:
    from qcompile.policy import AnyPolicy
    from qcompile.rl.ppo import Trainer
    from qcompile.rl.watch import Watch
    from qcompile.verbs.train_outputs import TrainingOutputs


class Training(Result):
    """The result of a training; `to_dict` is the document of `qcompile train --json`.

    `policy` can be played: it has circuits or a network. `save_policy` writes it to a file; `save`
    writes the document. `model` is the trained torch module. `interrupted` is true if Ctrl-C or an
    error (`failure`) ended the training, `stopped` if a callback did. `trainings` has this
    training, or those of all seeds.
    """

    def __init__(
        self,
        *,
        trainer: Trainer,
        policy: AnyPolicy,
        watch: Watch,
        outputs: TrainingOutputs,
        imports: Sequence[str],
        preset: str | None,
        interrupted: bool,
        failure: QcompileError | None,
    ):
        settings = trainer.settings
        checkpoint, out = outputs.checkpoint, outputs.out
        super().__init__(
            {
                "environment": trainer.environment,
                **({"environment_kwargs": trainer.arguments} if trainer.arguments else {}),
                "model": settings.model,
                "preset": preset,
                "seed": trainer.seed,
                "backend": settings.backend,
                "shots": "exact" if settings.shots is None else settings.shots,
                "mitigation": settings.mitigation,
                "hold": settings.hold,
                "episodes": len(trainer.history),
                "steps": trainer.steps,
                "decisions": trainer.decisions,
                "parameters": policy.parameter_count,
                "last_20_mean_reward": watch.averages.last,
                "best_20_mean_reward": watch.averages.best,
                "evaluations": [vars(evaluation) for evaluation in watch.evaluations],
                "checkpoint": None if checkpoint is None else str(checkpoint),
                "out": None if out is None else str(out),
                "interrupted": interrupted,
            }
        )
        self._imports = imports
        self._logs = {"--log": outputs.log, "--tensorboard": outputs.tensorboard}
        self.policy, self.failure, self.interrupted = policy, failure, interrupted
        self.stopped, self.trainings = watch.stopped, [self]
        self.model = trainer.model
        self._history, self._environments = trainer.history, settings.environments

    def _copy_episodes(self, other: Training) -> None:
        self._history, self._environments = other._history, other._environments

    @property
    def episodes(self) -> list[dict[str, Any]]:
        """Number and reward of each episode, with the total steps and decisions at its end."""
        return [vars(episode) for episode in self._history]

    @property
    def rewards(self) -> list[float]:
        """The reward of each episode, in the order in which they began."""
        from qcompile.rl.order import in_order_of_start

        ended = [(episode.decisions, episode.reward) for episode in self._history]
        return list(in_order_of_start(ended, self._environments))

    def plot(self, style: AnyStyle = None) -> Figure:
        """The learning curve: mean and standard deviation of the last 20 rewards.

        Raises:
            FigureError: the style cannot be read.
            QcompileError: no episode was finished.
        """
        values = self.to_dict()
        curve = self.curve(f"{values['model']}, mean and standard deviation")
        title = f"{values['environment']}, seed {values['seed']}"
        return draw_curves([CurvePanel(title, [curve])], style)

    def curve(self, label: str) -> Curve:
        """The curve that `plot` draws, with this label and its own colour.

        Raises:
            QcompileError: no episode was finished.
        """
        from qcompile.rl.order import AVERAGED

        rewards = np.array(self.rewards)
        if not len(rewards):
            raise QcompileError("No episode was finished: there is no curve.")
        last = [rewards[max(0, end - AVERAGED) : end] for end in range(1, len(rewards) + 1)]
        mean, spread = (np.array([of(part) for part in last]) for of in (np.mean, np.std))
        numbers = np.arange(1, len(rewards) + 1)
        return Curve(label, label, False, numbers, mean, mean - spread, mean + spread)

    def table(self) -> Table:
        """A row with its length and its averages."""
        values = self.to_dict()
        averages = [values["last_20_mean_reward"], values["best_20_mean_reward"]]
        columns = ["environment", "model", "seed", "episodes", "steps", "parameters"]
        row = [*(Cell.of(values[column]) for column in columns), *map(reward_cell, averages)]
        names = [*columns, "last 20", "best 20", "training"]
        left = ("environment", "model", "training")
        columns_of = [Column(name, right=name not in left) for name in names]
        return Table(columns_of, [[*row, self.ended]])

    @property
    def ended(self) -> str:
        """How the training ended, in one word."""
        if self.failure is not None:
            return "failed"
        return "interrupted" if self.interrupted else "stopped" if self.stopped else "complete"

    @property
    def words(self) -> str:
        """A summary: what was trained, its rewards, and where it was written."""
        values = self.to_dict()
        words = [f"{values['episodes']} episodes, {values['steps']} steps"]
        if not values["episodes"]:
            words.append("no episode finished")
        averages = {name: values[f"{name}_20_mean_reward"] for name in ("last", "best")}
        words += [
            f"{name} 20: {reward_text(mean)}" for name, mean in averages.items() if mean is not None
        ]
        if values["evaluations"]:
            words.append(f"evaluation: {reward_text(values['evaluations'][-1]['mean_reward'])}")
        line = f"{', '.join(words)}; {values['parameters']} parameters"
        return line if values["out"] is None else f"{line} in {values['out']}"

    def check_complete(self) -> None:
        """Check that the training was finished.

        Raises:
            QcompileError: an environment failed, or Ctrl-C ended it; the message says what is kept.
        """
        values = self.to_dict()
        out, state = values["out"], values["checkpoint"]
        if self.failure is not None:
            hint = f"The policy after the last complete update is in {out}."
            raise self.failure if out is None else self.failure.with_hints(hint)
        if not self.interrupted:
            return
        hints = [] if out is None else [f"The policy trained so far is in {out}."]
        if state is not None:
            words = ["qcompile", "train", values["environment"]]
            words += [word for module in self._imports for word in ("--import", module)]
            words += ["--resume", state] + ([] if out is None else ["--out", out])
            for option, path in self._logs.items():
                words += [] if path is None else [option, str(path)]
            hints.append(f"Resume with: {shlex.join(words)}")
        raise QcompileError("Interrupted.", *hints)
